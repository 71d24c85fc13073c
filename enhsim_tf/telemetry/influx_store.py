"""One series in InfluxDB 2, the kind of database at the end of the paper's pipeline."""

import dataclasses
import urllib.parse
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from enhsim_tf.common.errors import InputError

SCHEME = "influxdb://"
BATCH = 5_000  # points in one request
_SHOWN = 3  # number of series listed in a message


@dataclasses.dataclass(frozen=True)
class InfluxLocation:
    """Location of a series in InfluxDB."""

    bucket: str
    measurement: str
    field: str
    tags: tuple[tuple[str, str], ...] = ()  # pairs of tag and value that all points of the series have

    def __str__(self) -> str:
        path = "/".join(map(_encode, (self.bucket, self.measurement, self.field)))
        tags = "&".join("=".join(map(_encode, pair)) for pair in self.tags)
        return f"{SCHEME}{path}{'?' if tags else ''}{tags}"


def parse_location(text: str) -> InfluxLocation:
    """Parses `influxdb://bucket/measurement/field?tag=value&...`, with `/`, `?`, `&`, `=` and `%` percent-encoded in names.

    Raises:
        InputError: If the text does not have this form.
    """
    path, _, query = str(text).removeprefix(SCHEME).partition("?")
    try:
        if not str(text).startswith(SCHEME):
            raise ValueError
        str(text).encode()  # half a character is no text
        bucket, measurement, field = (urllib.parse.unquote(part, errors="strict") for part in path.split("/"))
        pairs = [pair.split("=") for pair in query.split("&")] if query else []
        tags = {urllib.parse.unquote(key, errors="strict"): urllib.parse.unquote(value, errors="strict") for key, value in pairs}
        if len(tags) < len(pairs) or not all((bucket, measurement, field, *tags, *tags.values())):
            raise ValueError
    except ValueError:
        raise InputError(
            f"Expected {SCHEME}bucket/measurement/field?tag=value, each tag once. Received: {text!r}. Percent-encode /, ?, &, = and % in names."
        ) from None
    return InfluxLocation(bucket, measurement, field, tuple(sorted(tags.items())))


class InfluxStore:
    """A series in InfluxDB 2.

    The server is set by the environment variables of the official client: `INFLUXDB_V2_URL`, `INFLUXDB_V2_TOKEN` and
    `INFLUXDB_V2_ORG`, and optional ones such as `INFLUXDB_V2_TIMEOUT` and `INFLUXDB_V2_SSL_CA_CERT`.

    Args:
        location: The location, as `influxdb://bucket/measurement/field?tag=value` or as an `InfluxLocation`.
        max_retry_s: How long to retry if a server that has answered before stops answering, in seconds.

    Raises:
        InputError: If the location or a variable cannot be used, or if the client is not installed.
    """

    def __init__(self, location: str | InfluxLocation, max_retry_s: float = 60.0):
        self.location = parse_location(str(location))
        try:
            from enhsim_tf.telemetry.influx_client import InfluxServer
        except ImportError:
            raise InputError(
                "Expected the package influxdb-client. Received: it is not installed. Run python -m pip install influxdb-client."
            ) from None
        self.server = InfluxServer(self.location.bucket, max_retry_s)

    def __repr__(self) -> str:
        return f"InfluxStore({str(self.location)!r})"

    def check(self) -> None:
        """Checks the connection to the server with an empty query.

        Raises:
            InputError: If the server does not answer, does not accept the token, or has no such organisation or bucket.
        """
        self.server.ask(f"{self.server.points({}, 0, 1)} |> limit(n: 1)")

    def write(self, times: np.ndarray, values: np.ndarray) -> None:
        """Writes points. A point that is written twice is stored once, so an interrupted write can be repeated.

        Args:
            times: Nanoseconds since 1970, int64 of shape `(samples,)`.
            values: Finite numbers, shape `(samples,)`.

        Raises:
            InputError: If InfluxDB cannot store a value or a name, or if the server does not accept the points.
        """
        from influxdb_client import Point

        place = self.location
        bad = np.flatnonzero(~np.isfinite(values))
        if len(bad):
            raise InputError(
                f"Expected finite values. Received: {values[bad[0]]} at sample {bad[0]}, which InfluxDB cannot store. Fill or cut it."
            )
        names = (place.measurement, place.field, *(part for pair in place.tags for part in pair))
        wrong = [part for part in names if not part.isprintable() or part.endswith("\\") or part.startswith(("_", "#")) or part == "time"]
        if wrong:
            raise InputError(
                "Expected names without control characters, a backslash at the end or _ or # at the beginning, and none that is time. "
                f"Received: {wrong[0]!r}. Write to another location."
            )
        point = {"measurement": place.measurement, "tags": dict(place.tags), "fields": {place.field: True}}
        begin = Point.from_dict(point).to_line_protocol().removesuffix("true")
        for first in range(0, len(values), BATCH):
            # float32 to float64 is exact, and so is the shortest decimal form of the float64
            batch = zip(*(array[first : first + BATCH].tolist() for array in (values, times)), strict=True)
            self.server.send("\n".join([f"{begin}{value!r} {time_ns}" for value, time_ns in batch]))

    def chunks(self) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """Streams the points of the only series at the location, whichever program wrote it, in blocks of some ten thousand points.

        Yields:
            Times in nanoseconds since 1970 (int64), which increase, and values (float64), two arrays of the same length.

        Raises:
            InputError: If there is no series, more than one, or one without numbers, or if the server does not answer.
        """
        wanted = {"_measurement": self.location.measurement, "_field": self.location.field} | dict(self.location.tags)
        rows = self.server.ask(f"{self.server.points(wanted)} |> first()", _SHOWN)
        found = [str(dataclasses.replace(self.location, tags=tuple(sorted(_tags_of(row).items())))) for row in rows]
        if len(found) > 1:
            raise InputError(f"Expected one series at {self.location}. Received: several. Name one by its tags: {' or '.join(found)}.")
        if not found:
            raise InputError(f"Expected points at {self.location}. Received: none. Correct the measurement, the field or the tags.")
        yield from self.server.stream(wanted)

    def read(self) -> tuple[np.ndarray, np.ndarray]:
        """Returns all points of the series at once, see `chunks`."""
        times, values = zip(*self.chunks(), strict=True)
        return np.concatenate(times), np.concatenate(values)


def _tags_of(row: Mapping[str, Any]) -> dict[str, str]:
    """The tags of a row of a query result: all columns except the time, the value and those that InfluxDB adds."""
    return {key: value for key, value in row.items() if not key.startswith("_") and key not in ("result", "table")}


def _encode(part: str) -> str:
    return urllib.parse.quote(part, safe="")
