"""One series in InfluxDB 2, the kind of database at the end of the paper's pipeline, through the
official client, an optional extra.

Every failure raises an `InputError` of one line. Only the client holds the token: no message, log
or pickled copy of a store contains it.
"""

import dataclasses
import itertools
import os
import re
import urllib.parse
from collections.abc import Callable, Sequence
from typing import Any, TypeVar

import numpy as np

from enhsim_tf.common.errors import InputError

SCHEME = "influxdb://"
BATCH = 5_000  # points in one request
VARIABLES = ("INFLUXDB_V2_URL", "INFLUXDB_V2_TOKEN", "INFLUXDB_V2_ORG")

_Answer = TypeVar("_Answer")
_SHOWN = 3  # number of series listed in a message
# all times that InfluxDB has, from a whole second
_RANGE = "start: time(v: -9223372036000000000), stop: time(v: 9223372036854775806)"
# without a name or a password
_URL = r"https?://(?:[\w.-]+|\[[\da-fA-F:.]+\])(?::[1-9]\d{0,4})?(?:/[!-~]*)?"
_TIMEOUT_MS = 60_000  # of a request, unless INFLUXDB_V2_TIMEOUT is set; a disk may be slow
# HTTP status codes of a server that is busy or still starting
_MAY_PASS = (408, 429, 500, 502, 503, 504)


@dataclasses.dataclass(frozen=True)
class InfluxLocation:
    """Location of a series in InfluxDB."""

    bucket: str
    measurement: str
    field: str
    # pairs of tag and value that all points of the series have
    tags: tuple[tuple[str, str], ...] = ()

    def __str__(self) -> str:
        path = "/".join(map(_encode, (self.bucket, self.measurement, self.field)))
        tags = "&".join("=".join(map(_encode, pair)) for pair in self.tags)
        return f"{SCHEME}{path}{'?' if tags else ''}{tags}"


def parse_location(text: str) -> InfluxLocation:
    """Parses `influxdb://bucket/measurement/field?tag=value&...`, with `/`, `?`, `&`, `=` and `%`
    percent-encoded in names.

    Raises:
        InputError: If the text does not have this form.
    """
    path, _, query = str(text).removeprefix(SCHEME).partition("?")
    try:
        if not str(text).startswith(SCHEME):
            raise ValueError
        str(text).encode()  # half a character is no text
        bucket, measurement, field = (
            urllib.parse.unquote(part, errors="strict") for part in path.split("/")
        )
        pairs = [pair.split("=") for pair in query.split("&")] if query else []
        tags = {
            urllib.parse.unquote(key, errors="strict"): urllib.parse.unquote(value, errors="strict")
            for key, value in pairs
        }
        if len(tags) < len(pairs) or not all((bucket, measurement, field, *tags, *tags.values())):
            raise ValueError
    except ValueError:
        raise InputError(
            f"Expected {SCHEME}bucket/measurement/field?tag=value, each tag once. Received: "
            f"{text!r}. Percent-encode /, ?, &, = and % in names."
        ) from None
    return InfluxLocation(bucket, measurement, field, tuple(sorted(tags.items())))


class InfluxStore:
    """A series in InfluxDB 2.

    The server is set by the environment variables of the official client: `INFLUXDB_V2_URL`,
    `INFLUXDB_V2_TOKEN` and `INFLUXDB_V2_ORG`, and optional ones such as `INFLUXDB_V2_TIMEOUT` and
    `INFLUXDB_V2_SSL_CA_CERT`. If a server that has answered stops answering, the client asks it
    again for a minute; one that has not answered is not waited for.

    Args:
        location: The location, as `influxdb://bucket/measurement/field?tag=value` or as an
            `InfluxLocation`.

    Raises:
        InputError: If the location or a variable cannot be used, or if the client is not installed.
    """

    def __init__(self, location: str | InfluxLocation):
        self.location = parse_location(str(location))
        try:
            import influxdb_client  # noqa: F401
        except ImportError:
            raise InputError(
                "Expected the package influxdb-client. Received: it is not installed. Run python "
                "-m pip install influxdb-client."
            ) from None
        self.url, self.organisation = _check_variables()

    def __repr__(self) -> str:
        return f"InfluxStore({str(self.location)!r})"

    def check(self) -> None:
        """Checks the connection to the server with an empty query.

        Raises:
            InputError: If the server does not answer, does not accept the token, or has no such
                organisation or bucket.
        """
        self._with_client(self._ask)

    def _ask(self, client: Any) -> None:
        """Sends an empty query. What fails from then on is repeated, because the server has
        answered.
        """
        query = (
            f"from(bucket: {_quote(self.location.bucket)}) |> range(start: time(v: 0), stop: "
            "time(v: 1)) |> limit(n: 1)"
        )
        client.query_api().query(query)
        pools = client.api_client.rest_client.pool_manager
        pools.connection_pool_kw["retries"] = _retry(16)
        pools.clear()  # those of the query

    def write(self, times: np.ndarray, values: np.ndarray) -> None:
        """Writes points. A point that is written twice is stored once, so an interrupted write can
        be repeated.

        Args:
            times: Nanoseconds since 1970, int64 of shape `(samples,)`.
            values: Finite numbers, shape `(samples,)`.

        Raises:
            InputError: If InfluxDB cannot store a value or a name, or if the server does not accept
                the points.
        """
        from influxdb_client import Point
        from influxdb_client.client.write_api import SYNCHRONOUS

        place = self.location
        bad = np.flatnonzero(~np.isfinite(values))
        if len(bad):
            raise InputError(
                f"Expected finite values. Received: {values[bad[0]]} at sample {bad[0]}, which "
                "InfluxDB cannot store. Fill or cut it."
            )
        names = (place.measurement, place.field, *(part for pair in place.tags for part in pair))
        wrong = [
            part
            for part in names
            if not part.isprintable()
            or part.endswith("\\")
            or part.startswith(("_", "#"))
            or part == "time"
        ]
        if wrong:
            raise InputError(
                "Expected names without control characters, a backslash at the end or _ or # at "
                "the beginning, and none that is time. "
                f"Received: {wrong[0]!r}. Write to another location."
            )
        point = {
            "measurement": place.measurement,
            "tags": dict(place.tags),
            "fields": {place.field: True},
        }
        begin = Point.from_dict(point).to_line_protocol().removesuffix("true")

        def send(client: Any) -> None:
            self._ask(client)
            # its own writer of data frames is not used: it evaluates the names of tags as code
            api = client.write_api(SYNCHRONOUS)
            for first in range(0, len(values), BATCH):
                # float32 to float64 is exact, and so is the shortest decimal form of the float64
                batch = zip(
                    *(array[first : first + BATCH].tolist() for array in (values, times)),
                    strict=True,
                )
                lines = "\n".join([f"{begin}{value!r} {time_ns}" for value, time_ns in batch])
                api.write(place.bucket, record=lines.encode(), write_precision="ns")

        self._with_client(send)

    def read(self) -> tuple[np.ndarray, np.ndarray]:
        """Reads all points of the only series at the location, whichever program wrote it.

        Returns:
            Times in nanoseconds since 1970 (int64), which increase, and values (float64), two
            arrays of the same length.

        Raises:
            InputError: If there is no series, more than one, or one without numbers, or if the
                server does not answer.
        """
        from influxdb_client import Dialect

        wanted = {"_measurement": self.location.measurement, "_field": self.location.field} | dict(
            self.location.tags
        )
        matches = " and ".join(
            f"r[{_quote(column)}] == {_quote(value)}" for column, value in wanted.items()
        )
        points = (
            f"from(bucket: {_quote(self.location.bucket)}) |> range({_RANGE}) |> filter(fn: (r) => "
            f"{matches})"
        )
        plain = Dialect(annotations=[])

        def query(client: Any) -> bytes:
            self._ask(client)
            api = client.query_api()
            rows = list(itertools.islice(api.query_stream(f"{points} |> first()"), _SHOWN))
            self._check_single(rows)
            values = f'{points} |> keep(columns: ["_time", "_value"])'
            return api.query_raw(values, dialect=plain).read()

        return _parse(self._with_client(query))

    def _check_single(self, rows: Sequence[Any]) -> None:
        """Raises InputError unless the rows, one of each series, are one."""
        if not rows:
            raise InputError(
                f"Expected points at {self.location}. Received: none. Correct the measurement, the "
                "field or the tags."
            )
        if len(rows) > 1:
            tags = [
                {
                    key: value
                    for key, value in row.values.items()
                    if not key.startswith("_") and key not in ("result", "table")
                }
                for row in rows
            ]
            places = " or ".join(
                str(dataclasses.replace(self.location, tags=tuple(sorted(pairs.items()))))
                for pairs in tags
            )
            raise InputError(
                f"Expected one series at {self.location}. Received: several. Name one by its tags: "
                f"{places}."
            )

    def _with_client(self, work: Callable[[Any], _Answer]) -> _Answer:
        """Calls a function with a client, which is closed then; raises an `InputError` if the
        server does not do what it asks for.
        """
        from influxdb_client import InfluxDBClient
        from influxdb_client.client.flux_csv_parser import (
            FluxCsvParserException,
            FluxQueryException,
        )
        from influxdb_client.rest import ApiException
        from urllib3.exceptions import HTTPError

        try:
            client = InfluxDBClient.from_env_properties(retries=_retry(0))
        except ValueError:
            raise InputError(
                "Expected numbers in INFLUXDB_V2_TIMEOUT and INFLUXDB_V2_CONNECTION_POOL_MAXSIZE. "
                "Received: others. Correct them."
            ) from None
        if "INFLUXDB_V2_TIMEOUT" not in os.environ:
            client.api_client.configuration.timeout = _TIMEOUT_MS
        try:
            with client:
                return work(client)
        except (
            ApiException,
            FluxQueryException,
            FluxCsvParserException,
            HTTPError,
            OSError,
        ) as error:
            status = getattr(error, "status", None)
            said = " ".join(
                str(
                    getattr(error, "message", None) if status else getattr(error, "reason", error)
                ).split()
            )[:300]
            if status == 401:
                words = (
                    f"Expected a token that {self.url} knows. Received: another in {VARIABLES[1]}. "
                    "Copy it again."
                )
            elif isinstance(error, FluxCsvParserException) or (status == 404 and "not" not in said):
                words = (
                    f"Expected an InfluxDB 2 server at {self.url}. Received: an answer of "
                    f"something else. Correct {VARIABLES[0]}."
                )
            elif isinstance(error, HTTPError | OSError):
                words = (
                    f"Expected an InfluxDB 2 server at {self.url}. Received: no answer. Start it "
                    f"or correct {VARIABLES[0]}."
                )
            else:
                words = (
                    f"Expected a request that {self.url} accepts, to bucket "
                    f"{self.location.bucket!r} of {VARIABLES[2]}={self.organisation!r}. "
                    f"Received: {said} ({status or 'query'}). Correct the names, or give the token "
                    "the right."
                )
        # outside the except block: the client's own error, which may contain the token, is not
        # chained
        raise InputError(words)


def _retry(number: int) -> Any:
    """Returns how often a request is repeated that may pass."""
    from urllib3 import Retry

    return Retry(
        number,
        redirect=False,
        allowed_methods=None,
        status_forcelist=_MAY_PASS,
        raise_on_status=False,
        backoff_factor=0.1,
        backoff_max=5,
    )


def _check_variables() -> tuple[str, str]:
    """Checks the environment variables that the client reads, whose own errors would show the
    token; returns URL and organisation.
    """
    missing = [name for name in VARIABLES if not os.environ.get(name, "").strip()]
    if missing:
        raise InputError(
            f"Expected the variables {', '.join(VARIABLES)}. Received: no "
            f"{' and no '.join(missing)}. Set them."
        )
    url, token, organisation = (os.environ[name] for name in VARIABLES)
    if not re.fullmatch(_URL, url):
        raise InputError(
            "Expected INFLUXDB_V2_URL like http://localhost:8086, without a name or a password. "
            "Received: another. Correct it."
        )
    if not (token.isascii() and token.isprintable()):
        raise InputError(
            "Expected INFLUXDB_V2_TOKEN of printable ASCII. Received: a line break or other "
            "characters in it. Copy it again."
        )
    return url.rstrip("/"), organisation


def _parse(answer: bytes) -> tuple[np.ndarray, np.ndarray]:
    """Parses the CSV of an answer as times and values. The client's own parser cuts times to
    microseconds.
    """
    import pyarrow as pa
    import pyarrow.csv

    types = {"_time": pa.timestamp("ns", "UTC"), "_value": pa.float64()}
    convert = pyarrow.csv.ConvertOptions(column_types=types, include_columns=list(types))
    try:
        table = pyarrow.csv.read_csv(pa.BufferReader(answer), convert_options=convert)
    except pa.ArrowException as error:
        reason = " ".join(str(error).split())[:200]
        raise InputError(
            f"Expected a field of numbers. Received: {reason}. Name another field, or see the "
            "server's log."
        ) from None
    return table["_time"].cast(pa.int64()).to_numpy(), table["_value"].to_numpy()


def _quote(text: str) -> str:
    """Quotes a text as a Flux string. Characters that could end it or start an interpolated
    expression are escaped as hex codes.
    """
    return '"' + re.sub(r'[\\"$\x00-\x1f\x7f]', lambda found: f"\\x{ord(found[0]):02x}", text) + '"'


def _encode(part: str) -> str:
    return urllib.parse.quote(part, safe="")
