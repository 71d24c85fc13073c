"""Requests to an InfluxDB 2 server through its official client, an optional extra that this module imports.

Temporary failures are retried; every other failure raises an `InputError` of one line. Only the client holds the token: no message,
log or pickled copy of these objects contains it.
"""

import contextlib
import itertools
import os
import re
import time
from collections.abc import Callable, Iterator, Mapping
from typing import Any, TypeVar

import numpy as np
import pyarrow as pa
import pyarrow.csv
from influxdb_client import Dialect, InfluxDBClient
from influxdb_client.client.flux_csv_parser import FluxCsvParserException, FluxQueryException
from influxdb_client.client.write_api import SYNCHRONOUS
from influxdb_client.rest import ApiException
from urllib3.exceptions import HTTPError

from enhsim_tf.common.errors import InputError

_FIRST_NS, _LAST_NS = -9_223_372_036 * 10**9, 2**63 - 2  # range of times in InfluxDB, nanoseconds since 1970, starting at a whole second
VARIABLES = ("INFLUXDB_V2_URL", "INFLUXDB_V2_TOKEN", "INFLUXDB_V2_ORG")

_Answer = TypeVar("_Answer")
_URL = r"https?://(?:[\w.-]+|\[[\da-fA-F:.]+\])(?::[1-9]\d{0,4})?(?:/[!-~]*)?"  # without a name or a password
_REFUSALS = (ApiException, FluxQueryException, FluxCsvParserException)
_MAY_PASS = (408, 429, 500, 502, 503, 504)  # HTTP status codes of a server that is busy or still starting
_TIMEOUT_MS = 60_000  # timeout of a request if INFLUXDB_V2_TIMEOUT is not set; a disk may be slow


class InfluxServer:
    """One bucket of the server that `INFLUXDB_V2_URL`, `INFLUXDB_V2_TOKEN` and `INFLUXDB_V2_ORG` name.

    A server that has answered before and stops is asked again for `max_retry_s` seconds; one that has never answered is not.
    """

    def __init__(self, bucket: str, max_retry_s: float = 60.0):
        self.bucket, self.max_retry_s, self._has_answered = bucket, max_retry_s, False
        self.url, self.organisation = _check_variables()
        try:
            self._client = InfluxDBClient.from_env_properties()
        except ValueError:
            raise InputError(
                "Expected numbers in INFLUXDB_V2_TIMEOUT and INFLUXDB_V2_CONNECTION_POOL_MAXSIZE. Received: others. Correct them."
            ) from None
        if "INFLUXDB_V2_TIMEOUT" not in os.environ:
            self._client.api_client.configuration.timeout = _TIMEOUT_MS

    def __reduce__(self) -> tuple:
        return InfluxServer, (self.bucket, self.max_retry_s)  # a copy opens its own connection, so the token is not pickled

    def send(self, lines: str) -> None:
        """Writes points in line protocol, with times in nanoseconds. It can be repeated, as a point that is written twice is stored once.

        The client's own writer of data frames is not used: it evaluates the names of tags as code.
        """
        self._repeat(lambda: self._client.write_api(SYNCHRONOUS).write(self.bucket, record=lines.encode(), write_precision="ns"))

    def ask(self, query: str, limit: int | None = None) -> list[Mapping[str, Any]]:
        """Runs a Flux query with a small result; returns its rows, or the first `limit` of them."""
        return self._repeat(lambda: [row.values for row in itertools.islice(self._client.query_api().query_stream(query), limit)])

    def points(self, wanted: Mapping[str, str], start_ns: int = _FIRST_NS, stop_ns: int = _LAST_NS) -> str:
        """Flux for the points of the bucket whose columns have the wanted values, from `start_ns` up to, but not including, `stop_ns`."""
        matches = " and ".join(f"r[{quote(column)}] == {quote(value)}" for column, value in wanted.items()) or "true"
        times = f"start: time(v: {start_ns}), stop: time(v: {stop_ns})"
        return f"from(bucket: {quote(self.bucket)}) |> range({times}) |> filter(fn: (r) => {matches})"

    def stream(self, wanted: Mapping[str, str]) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """Streams the points of one series in chronological order, block by block, so that memory does not grow with their number.

        If the connection breaks, the query is repeated from the point after the last one received; see `points` for `wanted`.

        Yields:
            Times in nanoseconds since 1970 (int64) and values (float64), two arrays of the same length.
        """
        start_ns, moved = _FIRST_NS, time.monotonic()
        while True:
            query = f'{self.points(wanted, start_ns)} |> keep(columns: ["_time", "_value"])'
            answer = self._repeat(lambda query=query: self._client.query_api().query_raw(query, dialect=Dialect(annotations=[])))
            with contextlib.closing(answer):
                try:
                    for times, values in _blocks(answer):
                        yield times, values
                        start_ns, moved = int(times[-1]) + 1, time.monotonic()
                    return
                except (HTTPError, OSError):
                    is_late = time.monotonic() - moved > self.max_retry_s
            if is_late:
                raise InputError(
                    f"Expected a complete answer of {self.url}. Received: only a part of it, repeatedly. See the server's log."
                )
            time.sleep(0.1)

    def _repeat(self, request: Callable[[], _Answer]) -> _Answer:
        """Repeats a request until it succeeds; raises an `InputError` if it cannot succeed or takes longer than `max_retry_s`."""
        until, pause_s = time.monotonic() + self.max_retry_s, 0.1
        while True:
            try:
                answer = request()
            except (*_REFUSALS, HTTPError, OSError) as error:
                may_pass = not isinstance(error, _REFUSALS) or getattr(error, "status", None) in _MAY_PASS
                words = self._in_words(error)
            else:
                self._has_answered = True
                return answer
            if not (may_pass and self._has_answered and time.monotonic() + pause_s < until):
                raise InputError(words)  # outside the except block: the client's own error, which may contain the token, is not chained
            time.sleep(pause_s)
            pause_s = min(2 * pause_s, 5.0)

    def _in_words(self, error: Exception) -> str:
        status = getattr(error, "status", None)
        said = " ".join(str(getattr(error, "message", None) if status else getattr(error, "reason", error)).split())[:300]
        if status == 401:
            return f"Expected a token that {self.url} knows. Received: another in {VARIABLES[1]}. Copy it again."
        if isinstance(error, FluxCsvParserException) or (status == 404 and "not" not in said):
            return f"Expected an InfluxDB 2 server at {self.url}. Received: an answer of something else. Correct {VARIABLES[0]}."
        if not isinstance(error, _REFUSALS):
            waited = f" for {self.max_retry_s:g} s" if self._has_answered else ""
            return f"Expected an InfluxDB 2 server at {self.url}. Received: no answer{waited}. Start it or correct {VARIABLES[0]}."
        return (
            f"Expected a request that {self.url} accepts, to bucket {self.bucket!r} of {VARIABLES[2]}={self.organisation!r}. "
            f"Received: {said} ({status or 'query'}). Correct the names, or give the token the right."
        )


def quote(text: str) -> str:
    """Quotes a text as a Flux string. Characters that could end it or start an interpolated expression are escaped as hex codes."""
    return '"' + re.sub(r'[\\"$\x00-\x1f\x7f]', lambda found: f"\\x{ord(found[0]):02x}", text) + '"'


def _check_variables() -> tuple[str, str]:
    """Checks the environment variables that the client reads, whose own errors would show the token; returns URL and organisation."""
    missing = [name for name in VARIABLES if not os.environ.get(name, "").strip()]
    if missing:
        raise InputError(f"Expected the variables {', '.join(VARIABLES)}. Received: no {' and no '.join(missing)}. Set them.")
    url, token, organisation = (os.environ[name] for name in VARIABLES)
    if not re.fullmatch(_URL, url):
        raise InputError(
            "Expected INFLUXDB_V2_URL like http://localhost:8086, without a name or a password. Received: another. Correct it."
        )
    if not (token.isascii() and token.isprintable()):
        raise InputError("Expected INFLUXDB_V2_TOKEN of printable ASCII. Received: a line break or other characters in it. Copy it again.")
    return url.rstrip("/"), organisation


def _blocks(answer: Any) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Parses the CSV of a response block by block; yields times and values. The client's own parser cuts times to microseconds."""
    answer.auto_close = False  # Arrow asks whether it is closed after its end
    types = {"_time": pa.timestamp("ns", "UTC"), "_value": pa.float64()}
    convert = pyarrow.csv.ConvertOptions(column_types=types, include_columns=list(types))
    try:
        with pyarrow.csv.open_csv(answer, convert_options=convert) as batches:
            for batch in batches:
                if len(batch):
                    yield batch["_time"].cast(pa.int64()).to_numpy(), batch["_value"].to_numpy(zero_copy_only=False)
    except pa.ArrowException as error:
        reason = " ".join(str(error).split())[:200]
        if "Empty CSV" not in reason:  # no points
            raise InputError(f"Expected a field of numbers. Received: {reason}. Name another field, or see the server's log.") from None
