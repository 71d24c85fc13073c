"""A telemetry store in InfluxDB 2, the kind of database at the end of the paper's pipeline.

Each series is written under a version tag, the hash of its content. A description that is written last makes this version the
current one. An interrupted write therefore never leaves a partial series, a repeated write stores the series once, and the old
version remains valid until the new one is complete. Series written by other programs are read as they are stored.
"""

import dataclasses
import hashlib
import json
import re
import urllib.parse
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from enhsim_tf.common.errors import InputError
from enhsim_tf.telemetry.series import Telemetry, check_telemetry, nanoseconds

SCHEME = "influxdb://"
BATCH = 5_000  # points in one request
_ABOUT, _ABOUT_NS = "enhsim_tf_series", 4_102_444_800 * 10**9  # descriptions have a time in the year 2100, beyond any retention period
_CHANNEL, _VERSION = "channel", "version"  # tags of the series written by this class
_DESCRIBED = [field.name for field in dataclasses.fields(Telemetry) if field.name != "values"]
_SHOWN = 3  # number of series listed in a message


@dataclasses.dataclass(frozen=True)
class InfluxLocation:
    """Location of a series, or of a store with several series, in InfluxDB."""

    bucket: str
    measurement: str
    field: str
    tags: tuple[tuple[str, str], ...] = ()  # pairs of tag and value that all points of the location have

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
    """A store in one measurement and field of InfluxDB 2. The tag `channel` distinguishes its series.

    The server is set by the environment variables of the official client: `INFLUXDB_V2_URL`, `INFLUXDB_V2_TOKEN` and
    `INFLUXDB_V2_ORG`, and optional ones such as `INFLUXDB_V2_TIMEOUT` and `INFLUXDB_V2_SSL_CA_CERT`. Values must be finite, and
    times are whole nanoseconds. Only one process at a time may write a series.

    Args:
        location: The location, as `influxdb://bucket/measurement/field?tag=value` or as an `InfluxLocation`. Every point gets its
            tags.
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

    def write(self, telemetry: Telemetry) -> None:
        """Stores a series atomically under its name. An existing series of that name is replaced.

        Raises:
            InputError: If the series has no name, no samples, values that are not finite, or samples less than a nanosecond apart,
                or if the server does not accept it.
        """
        from influxdb_client import Point

        times, values = _points(telemetry)
        self._check_names(telemetry.name)
        about = {key: getattr(telemetry, key) for key in _DESCRIBED} | {"num_samples": len(values), "location": str(self.location)}
        about |= {key: float(about[key]) for key in ("interval_s", "offset_s")}
        version = hashlib.sha256(json.dumps(about).encode() + values.tobytes()).hexdigest()[:16]
        tags = dict(self.location.tags) | {_CHANNEL: _as_tag(telemetry.name), _VERSION: version}
        point = {"measurement": self.location.measurement, "tags": tags, "fields": {self.location.field: True}}
        begin = Point.from_dict(point).to_line_protocol().removesuffix("true")
        for first in range(0, len(values), BATCH):
            # float32 to float64 is exact, and so is the shortest decimal form of the float64
            batch = zip(*(array[first : first + BATCH].tolist() for array in (values, times)), strict=True)
            self.server.send("\n".join([f"{begin}{value!r} {time_ns}" for value, time_ns in batch]))
        point = {"measurement": _ABOUT, "tags": {"key": self._hash(telemetry.name), "store": self._hash()}, "time": _ABOUT_NS}
        self.server.send(Point.from_dict(point | {"fields": {"about": json.dumps(about | {_VERSION: version})}}).to_line_protocol())
        rows = self.server.ask(f"{self.server.points(self._wanted({_CHANNEL: tags[_CHANNEL]}))} |> first()")
        for old in {row[_VERSION] for row in rows if _VERSION in row and _tags_of(row) == tags | {_VERSION: row[_VERSION]}} - {version}:
            if re.fullmatch(r"[0-9a-f]{16}", old):  # otherwise it is a tag of another program with the same name
                self.server.delete(f'{_VERSION}="{old}"')

    def read(self, name: str) -> Telemetry:
        """Reads the series stored under `name`.

        Raises:
            InputError: If there is no such series, if samples are missing from it, or if the server does not answer.
        """
        about = self._abouts({"key": self._hash(name)}).get(name)
        if about is None:
            raise InputError(f"Expected a series of this store: {', '.join(self.names()) or 'it is empty'}. Received: {name!r}.")
        stream = self.server.stream(self._wanted({_CHANNEL: _as_tag(name), _VERSION: about[_VERSION]}))
        blocks = [(np.empty(0, np.int64), np.empty(0)), *stream]
        times, values = (np.concatenate(arrays)[: about["num_samples"]] for arrays in zip(*blocks, strict=True))
        telemetry = Telemetry(values.astype(np.float32), **{key: about[key] for key in _DESCRIBED})
        found = np.append(times == nanoseconds(telemetry), False).argmin()  # number of leading points with the expected times
        if found < about["num_samples"]:
            raise InputError(
                f"Expected {about['num_samples']:,} samples of {name!r}. Received: a gap before sample {found}. Write the series again."
            )
        return telemetry

    def names(self) -> list[str]:
        """The sorted names of the stored series."""
        return sorted(self._abouts({"store": self._hash()}))

    def check(self) -> None:
        """Checks the connection to the server with an empty query.

        Raises:
            InputError: If the server does not answer, does not accept the token, or has no such organisation or bucket.
        """
        self.server.ask(f"{self.server.points({}, 0, 1)} |> limit(n: 1)")

    def chunks(self) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """Streams the points of the only series at the location, whichever program wrote it, in blocks of some ten thousand points.

        Yields:
            Times in nanoseconds since 1970 (int64), which increase, and values (float64), two arrays of the same length.

        Raises:
            InputError: If there is no series, more than one, or one without numbers, or if the server does not answer.
        """
        rows = self.server.ask(f"{self.server.points(self._wanted())} |> first()", _SHOWN)
        found = [str(dataclasses.replace(self.location, tags=tuple(sorted(_tags_of(row).items())))) for row in rows]
        if len(found) > 1:
            raise InputError(f"Expected one series at {self.location}. Received: several. Name one by its tags: {' or '.join(found)}.")
        if not found:
            raise InputError(f"Expected points at {self.location}. Received: none. Correct the measurement, the field or the tags.")
        yield from self.server.stream(self._wanted())

    def _check_names(self, name: str) -> None:
        """Raises an `InputError` for names that line protocol cannot express, and for tags that the store uses itself."""
        pairs = self.location.tags
        names = (self.location.measurement, self.location.field, *(part for pair in pairs for part in pair))
        bad = [part for part in names if not part.isprintable() or part.endswith("\\") or part.startswith(("_", "#"))]
        bad += [tag for tag, _ in pairs if tag in (_CHANNEL, _VERSION, "time")]
        if bad:
            raise InputError(
                "Expected names without control characters, a backslash at the end or _ or # at the beginning, and no tag "
                f"{_CHANNEL}, {_VERSION} or time. Received: {bad[0]!r}. Write to another location."
            )
        try:
            name.encode()
        except UnicodeError:
            raise InputError(f"Expected a name of Unicode characters. Received: {name!r}. Choose another.") from None

    def _hash(self, *names: str) -> str:
        return hashlib.sha256(json.dumps([str(self.location), *names]).encode()).hexdigest()[:16]

    def _abouts(self, which: Mapping[str, str]) -> dict[str, dict[str, Any]]:
        """Descriptions by name, of the series whose description has a tag."""
        wanted = {"_measurement": _ABOUT, "_field": "about"} | which
        rows = self.server.ask(self.server.points(wanted, _ABOUT_NS, _ABOUT_NS + 1))
        return {about["name"]: about for about in (_description(row.get("_value")) for row in rows)}

    def _wanted(self, tags: Mapping[str, str] | None = None) -> dict[str, str]:
        """The columns that points of this location have, and further tags."""
        place = self.location
        return {"_measurement": place.measurement, "_field": place.field} | dict(place.tags) | (tags or {})


def _points(telemetry: Telemetry) -> tuple[np.ndarray, np.ndarray]:
    """Checks that a series can be stored; returns its times in nanoseconds and its values."""
    check_telemetry(telemetry)
    if not telemetry.name or not len(telemetry):
        raise InputError(f"Expected a series with a name and samples. Received: {len(telemetry)} samples, name={telemetry.name!r}.")
    values = np.ascontiguousarray(telemetry.values, np.float32)
    bad = np.flatnonzero(~np.isfinite(values))
    if len(bad):
        raise InputError(
            f"Expected finite values. Received: {values[bad[0]]} at sample {bad[0]}, which InfluxDB cannot store. Fill or cut it."
        )
    times = nanoseconds(telemetry)
    if (np.diff(times) <= 0).any():
        raise InputError(f"Expected samples at least a nanosecond apart. Received: interval_s={telemetry.interval_s!r}. Check the unit.")
    return times, values


def _description(text: Any) -> dict[str, Any]:
    """Parses a description written by `write`; refuses anything else, since other programs can write there too."""
    kinds = {"name": str, "unit": str, _VERSION: str, "start": str | None, "interval_s": float, "offset_s": float, "num_samples": int}
    try:
        about = json.loads(text)
        is_good = all(isinstance(about[key], kind) for key, kind in kinds.items()) and 1 <= about["num_samples"] < 2**53
        is_good = is_good and np.isfinite([about["interval_s"], about["offset_s"]]).all()
    except (ValueError, TypeError, KeyError, RecursionError):
        is_good = False
    if not is_good:
        raise InputError(f"Expected descriptions of series as they were written. Received: {str(text)[:80]!r}. Write the series again.")
    return about


def _tags_of(row: Mapping[str, Any]) -> dict[str, str]:
    """The tags of a row of a query result: all columns except the time, the value and those that InfluxDB adds."""
    return {key: value for key, value in row.items() if not key.startswith("_") and key not in ("result", "table")}


def _encode(part: str) -> str:
    return urllib.parse.quote(part, safe="")


def _as_tag(name: str) -> str:
    """Encodes a name as a tag value. Characters that InfluxDB does not allow there are percent-encoded."""
    return "".join(sign if sign.isprintable() and sign not in "%\\" else urllib.parse.quote(sign) for sign in name)
