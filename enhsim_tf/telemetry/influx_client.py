"""Requests to an InfluxDB 2 server through its official client.

Temporary failures are retried; every other failure raises an `InputError` of one line. The module does not depend on telemetry.
Only the client holds the token: no message, log or pickled copy of these objects contains it.
"""

import contextlib
import io
import itertools
import os
import re
import time
import urllib.parse
from collections.abc import Callable, Iterator, Mapping
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from enhsim_tf.common.errors import InputError

if TYPE_CHECKING:
    from influxdb_client import InfluxDBClient

FIRST_NS, LAST_NS = -9_223_372_036 * 10**9, 2**63 - 2  # range of times in InfluxDB, nanoseconds since 1970, starting at a whole second
VARIABLES = ("INFLUXDB_V2_URL", "INFLUXDB_V2_TOKEN", "INFLUXDB_V2_ORG")

_Answer = TypeVar("_Answer")
_ALL_TIME = "1677-09-21T00:12:44Z", "2262-04-11T23:47:16.854775806Z"
_BLOCK = 1 << 20  # bytes of a response that are parsed at once
_MAY_PASS = (408, 429, 500, 502, 503, 504)  # HTTP status codes of a server that is busy or still starting
_TIMEOUT_MS = 60_000  # timeout of a request if INFLUXDB_V2_TIMEOUT is not set; a disk may be slow
_NUMERIC = {"double": "float64", "long": "int64", "unsignedLong": "uint64"}


class InfluxServer:
    """One bucket of the server that `INFLUXDB_V2_URL`, `INFLUXDB_V2_TOKEN` and `INFLUXDB_V2_ORG` name.

    Args:
        bucket: Name of the bucket.
        max_retry_s: How long to retry if a server that has answered before stops answering, in seconds. If a server has never
            answered, there are no retries.

    Raises:
        InputError: If a variable is missing or cannot be used, or if the client is not installed.
    """

    def __init__(self, bucket: str, max_retry_s: float = 60.0):
        self.bucket, self.max_retry_s = bucket, max_retry_s
        self.url, self.organisation = _variables()
        try:
            import influxdb_client  # noqa: F401 - checks that it is installed
        except ImportError:
            raise InputError(
                "Expected the package influxdb-client. Received: it is not installed. Run python -m pip install influxdb-client."
            ) from None
        self._opened: InfluxDBClient | None = None
        self._has_answered = False

    def __getstate__(self) -> dict[str, Any]:
        return self.__dict__ | {"_opened": None}  # another process opens its own connection, so the token is not pickled

    def close(self) -> None:
        """Closes the connections. The next request opens new ones."""
        if self._opened is not None:
            self._opened.close()
            self._opened = None

    # -- requests ------------------------------------------------------------------------------------------------------

    def send(self, lines: str) -> None:
        """Writes points. The request can be repeated safely, because writing a point twice stores it once.

        Args:
            lines: Points in line protocol, with times in nanoseconds.
        """
        from influxdb_client.client.write_api import SYNCHRONOUS

        record = lines.encode()
        self._repeat(lambda client: client.write_api(SYNCHRONOUS).write(self.bucket, record=record, write_precision="ns"))

    def delete(self, predicate: str) -> None:
        """Deletes all points that match a predicate, at any time."""
        self._repeat(lambda client: client.delete_api().delete(*_ALL_TIME, predicate, self.bucket, self.organisation))

    def ask(self, query: str, limit: int | None = None) -> list[Mapping[str, Any]]:
        """Runs a Flux query with a small result; returns its rows, or the first `limit` of them."""
        return self._repeat(lambda client: [record.values for record in itertools.islice(client.query_api().query_stream(query), limit)])

    def stream(self, steps: str, start_ns: int, stop_ns: int) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """Streams the points of one series in chronological order, block by block, so that memory does not grow with their number.

        If the connection breaks, the query is repeated from the point after the last one received.

        Args:
            steps: Flux that selects the series among the points of the bucket, `|> filter(...)`.
            start_ns: Start of the time range in nanoseconds since 1970 (inclusive).
            stop_ns: End of the time range in nanoseconds since 1970 (exclusive).

        Yields:
            Times in nanoseconds since 1970 (int64) and values (float64), two arrays of the same length.

        Raises:
            InputError: If the server does not answer, or the connection keeps breaking.
        """
        from influxdb_client import Dialect
        from urllib3.exceptions import HTTPError

        dialect = Dialect(header=True, delimiter=",", annotations=["datatype"], date_time_format="RFC3339")
        moved = time.monotonic()
        while start_ns < stop_ns:
            query = f'{self.points(start_ns, stop_ns)} {steps} |> keep(columns: ["_time", "_value"])'
            answer = self._repeat(lambda client, query=query: client.query_api().query_raw(query, dialect=dialect))
            is_broken = False
            with contextlib.closing(answer):
                blocks = _blocks(answer)
                while True:
                    try:
                        block = next(blocks, None)
                    except (HTTPError, OSError):
                        is_broken = True
                    if is_broken or block is None:
                        break
                    yield block
                    start_ns, moved = int(block[0][-1]) + 1, time.monotonic()
            if not is_broken:
                return
            time.sleep(0.1)
            if time.monotonic() - moved > self.max_retry_s:
                raise InputError(
                    f"Expected a complete answer of {self.url}. Received: only a part of it, repeatedly. See the server's log."
                )

    def points(self, start_ns: int = FIRST_NS, stop_ns: int = LAST_NS) -> str:
        """The Flux expression for all points of the bucket from `start_ns` (inclusive) to `stop_ns` (exclusive)."""
        return f"from(bucket: {quote(self.bucket)}) |> range(start: time(v: {start_ns}), stop: time(v: {stop_ns}))"

    # -- connection and retries ----------------------------------------------------------------------------------------

    def _client(self) -> "InfluxDBClient":
        if self._opened is None:
            from influxdb_client import InfluxDBClient

            _variables()  # check again: they may have changed
            try:
                self._opened = InfluxDBClient.from_env_properties()
            except ValueError:
                self._opened = None
            if self._opened is None:
                raise InputError(
                    "Expected numbers in INFLUXDB_V2_TIMEOUT and INFLUXDB_V2_CONNECTION_POOL_MAXSIZE. Received: others. Correct them."
                )
            if "INFLUXDB_V2_TIMEOUT" not in os.environ:
                self._opened.api_client.configuration.timeout = _TIMEOUT_MS
        return self._opened

    def _repeat(self, request: Callable[["InfluxDBClient"], _Answer]) -> _Answer:
        """Repeats a request until it succeeds; raises an `InputError` if it cannot succeed or takes longer than `max_retry_s`."""
        from influxdb_client.client.flux_csv_parser import FluxCsvParserException, FluxQueryException
        from influxdb_client.rest import ApiException
        from urllib3.exceptions import HTTPError

        said_no = ApiException, FluxQueryException, FluxCsvParserException
        began, pause_s = time.monotonic(), 0.1
        while True:
            try:
                answer = request(self._client())
            except (*said_no, HTTPError, OSError) as error:
                status = getattr(error, "status", None)
                is_final = isinstance(error, said_no) and status not in _MAY_PASS
                words = self._in_words(error, status)
            else:
                self._has_answered = True
                return answer
            if is_final or not self._has_answered or time.monotonic() - began + pause_s > self.max_retry_s:
                raise InputError(
                    words
                )  # raised outside the except block: the client's own error, which may contain the token, is not chained
            time.sleep(pause_s)
            pause_s = min(2 * pause_s, 5.0)

    def _in_words(self, error: Exception, status: int | None) -> str:
        said = str(getattr(error, "message", None) if status else getattr(error, "reason", error))
        said = " ".join(said.replace(os.environ.get(VARIABLES[1]) or "\n", "***").split())[:300]
        if status == 401:
            return f"Expected a token that {self.url} knows. Received: another in {VARIABLES[1]}. Copy it again."
        if status == 403:
            return f"Expected a token that may do this in bucket {self.bucket!r}. Received: {said}. Give it the right or name another."
        if "organization name" in said:
            return f"Expected an organisation of {self.url}. Received: {VARIABLES[2]}={self.organisation!r}. Correct it."
        if "bucket" in said and (status == 404 or "not find" in said):
            return (
                f"Expected a bucket of organisation {self.organisation!r} that the token may see. Received: {self.bucket!r}. "
                "Create it or name another."
            )
        if status == 404 or type(error).__name__ == "FluxCsvParserException":
            return f"Expected an InfluxDB 2 server at {self.url}. Received: an answer of something else. Correct {VARIABLES[0]}."
        if "outside retention policy" in said:
            return (
                f"Expected times that bucket {self.bucket!r} retains. Received: older ones ({said}). Write to a bucket that retains more."
            )
        if status is None and not type(error).__module__.startswith("influxdb_client"):
            waited = f" for {self.max_retry_s:g} s" if self._has_answered else ""
            return f"Expected an InfluxDB 2 server at {self.url}. Received: no answer{waited}. Start it or correct {VARIABLES[0]}."
        return f"Expected a request that {self.url} can do. Received: {said or type(error).__name__} ({status or 'query'}). See its log."


def _variables() -> tuple[str, str]:
    """Checks the environment variables that the client reads, whose own errors would show the token; returns URL and organisation."""
    missing = [name for name in VARIABLES if not os.environ.get(name, "").strip()]
    if missing:
        raise InputError(f"Expected the variables {', '.join(VARIABLES)}. Received: no {' and no '.join(missing)}. Set them.")
    url, token, organisation = (os.environ[name] for name in VARIABLES)
    try:
        parts = urllib.parse.urlsplit(url)
        usable = parts.scheme in ("http", "https") and parts.hostname and parts.port != 0 and url.isprintable() and " " not in url
    except ValueError:
        usable = False
    if not usable or parts.username or parts.password:
        raise InputError(
            "Expected INFLUXDB_V2_URL like http://localhost:8086, without a name or a password. Received: another. Correct it."
        )
    if not (token.isascii() and token.isprintable()):
        raise InputError("Expected INFLUXDB_V2_TOKEN of printable ASCII. Received: a line break or other characters in it. Copy it again.")
    return url.rstrip("/"), organisation


def quote(text: str) -> str:
    """Quotes a text as a Flux string. Characters that could end it or start an interpolated expression are escaped as hex codes."""
    return '"' + re.sub(r'[\\"$\x00-\x1f\x7f]', lambda found: f"\\x{ord(found[0]):02x}", text) + '"'


def escape(text: str, characters: str = ",= ") -> str:
    """Escapes a name for line protocol with backslashes before `characters`."""
    return re.sub(f"[{characters}]", lambda found: f"\\{found[0]}", text)


def _blocks(answer: Any) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Parses a response in annotated CSV block by block; yields times and values."""
    left, kind = b"", None
    while True:
        data = answer.read(_BLOCK)
        block = left + data
        cut = block.rfind(b"\n") + 1
        block, left = block[:cut], block[cut:]
        if left and not data:
            raise ConnectionError("the answer ends within a line")
        if kind is None and block.strip() and (block.count(b"\n") < 2 and data):  # the header is not complete yet
            left = block + left
            continue
        try:
            if kind is None and block.strip():
                head, kind, block = _head(block)
            if block.startswith(b"#") or b"\n#" in block:  # an error, which InfluxDB appends as a second table after the points
                said = (block + left + answer.read(_BLOCK)).split(b"reference", 1)[-1]
                said = " ".join(said.decode(errors="replace").split()).strip(" ,")
                raise InputError(f"Expected the points of a series. Received: some points and then an error of InfluxDB: {said[:300]}.")
            found = _parse(block, head, kind) if block.strip() else None
        except InputError:
            raise
        except (ValueError, KeyError, TypeError) as error:  # includes Arrow's errors
            reason = " ".join(str(error).split())[:120]
            raise InputError(
                f"Expected points as InfluxDB writes them. Received: another answer ({reason}). See the server's log."
            ) from None
        if found is not None:
            yield found
        if not data:
            return


def _head(block: bytes) -> tuple[list[str], str, bytes]:
    """Parses the header of a response: the names of the columns, the type of the values, and the remaining bytes."""
    kinds, names, rows = block.split(b"\n", 2)
    kinds, names = (line.decode().strip().split(",") for line in (kinds, names))
    kind = dict(zip(names, kinds, strict=False)).get("_value", "none")
    if kind not in _NUMERIC:
        raise InputError(f"Expected a field of numbers. Received: values of type {kind}. Name another field.")
    return names, kind, rows


def _parse(block: bytes, names: list[str], kind: str) -> tuple[np.ndarray, np.ndarray]:
    import pyarrow as pa
    import pyarrow.csv

    # the client's own parser would truncate times to microseconds
    types = {"_time": pa.timestamp("ns", "UTC"), "_value": pa.type_for_alias(_NUMERIC[kind])}
    table = pyarrow.csv.read_csv(
        io.BytesIO(block),
        pyarrow.csv.ReadOptions(column_names=[name or "-" for name in names], use_threads=False),
        convert_options=pyarrow.csv.ConvertOptions(column_types=types, include_columns=list(types)),
    )
    return table["_time"].cast(pa.int64()).to_numpy(), table["_value"].to_numpy().astype(np.float64)
