"""Telemetry at rest in InfluxDB 2, behind the interface of `store`: the database that the paper's pipeline ends in.

Every series is written under a version, the hash of its content, and a description written last makes that version the
series. So what is interrupted is never half a series, what is written twice is there once, and the old stands until the new
is whole. The series of others are read as they are stored.
"""

import dataclasses
import hashlib
import json
import re
import urllib.parse
from collections.abc import Iterator, Mapping
from typing import Any, NoReturn

import numpy as np

from enhsim_tf.common.errors import InputError
from enhsim_tf.telemetry.influx_client import FIRST_NS, LAST_NS, InfluxServer, escape, quote
from enhsim_tf.telemetry.series import Telemetry, check_telemetry, nanoseconds

SCHEME = "influxdb://"
_ABOUT, _ABOUT_NS = "enhsim_tf_series", 4_102_444_800 * 10**9  # descriptions stand in the year 2100, where no bucket's retention ends
_CHANNEL, _VERSION = "channel", "version"  # the tags of a series of ours
_IS_VERSION = re.compile(r"[0-9a-f]{16}")
_DESCRIBED = [field.name for field in dataclasses.fields(Telemetry) if field.name != "values"]
_SHOWN = 8  # names that a message lists


@dataclasses.dataclass(frozen=True)
class InfluxLocation:
    """Where a series, or a store of several, lives in InfluxDB.

    Args:
        bucket: Name of the bucket.
        measurement: Name of the measurement.
        field: Name of the field.
        tags: Pairs of tag and value that its points carry.
    """

    bucket: str
    measurement: str
    field: str
    tags: tuple[tuple[str, str], ...] = ()

    def __str__(self) -> str:
        path = "/".join(map(_encode, (self.bucket, self.measurement, self.field)))
        tags = "&".join("=".join(map(_encode, pair)) for pair in self.tags)
        return f"{SCHEME}{path}{'?' if tags else ''}{tags}"


def parse_location(text: str) -> InfluxLocation:
    """Reads `influxdb://bucket/measurement/field?tag=value&...`, with `/`, `?`, `&`, `=` and `%` percent-encoded in names.

    Raises:
        InputError: If a part is missing or it is no such location.
    """

    def refuse(why: str) -> NoReturn:
        raise InputError(
            f"Expected {SCHEME}bucket/measurement/field?tag=value. Received: {text!r}, {why}. Percent-encode /, ?, &, = and % in names."
        )

    def decode(part: str) -> str:
        try:
            return urllib.parse.unquote(part, errors="strict")
        except UnicodeError:
            refuse("which is not UTF-8")

    if not isinstance(text, str) or not text.startswith(SCHEME):
        refuse(f"which does not begin with {SCHEME}")
    if any("\ud800" <= letter <= "\udfff" for letter in text):
        refuse("which is not UTF-8")
    path, _, query = text.removeprefix(SCHEME).partition("?")
    parts = [decode(part) for part in path.split("/")]
    for number, what in enumerate(("bucket", "measurement", "field")):
        if len(parts) <= number or not parts[number]:
            refuse(f"which names no {what}")
    if len(parts) > 3:
        refuse("which has more than three parts")
    tags = [tuple(decode(part) for part in pair.split("=")) for pair in query.split("&")] if query else []
    if not all(len(pair) == 2 and all(pair) for pair in tags):
        refuse("whose tags are not all of the form tag=value")
    if len(dict(tags)) < len(tags):
        refuse("which names a tag twice")
    return InfluxLocation(*parts, tuple(sorted(tags)))


class InfluxStore:
    """Series of one measurement and field of InfluxDB 2, told apart by the tag `channel`.

    The server is the one that the official client's variables name: `INFLUXDB_V2_URL`, `INFLUXDB_V2_TOKEN`, `INFLUXDB_V2_ORG`; its
    further ones (`INFLUXDB_V2_TIMEOUT`, `INFLUXDB_V2_SSL_CA_CERT` and so on) hold too. Values are finite, times whole nanoseconds.
    One process at a time writes a series.

    Args:
        location: Where, as `influxdb://bucket/measurement/field?tag=value` or an `InfluxLocation`; each point gets its tags.
        batch_size: Points sent at once.
        max_retry_s: How long a server that has answered before may be away until it is given up, in seconds.

    Raises:
        InputError: If the location or a variable cannot be used, or if the client is not installed.
    """

    def __init__(self, location: str | InfluxLocation, batch_size: int = 5_000, max_retry_s: float = 60.0):
        self.location = parse_location(str(location))
        if batch_size < 1 or not max_retry_s >= 0:
            raise InputError(f"Expected batch_size >= 1 and max_retry_s >= 0. Received: {batch_size} and {max_retry_s}. Correct them.")
        self.batch_size = batch_size
        self.server = InfluxServer(self.location.bucket, max_retry_s)

    def __repr__(self) -> str:
        return f"InfluxStore({str(self.location)!r})"

    # -- the interface of every store ----------------------------------------------------------------------------------

    def write(self, telemetry: Telemetry) -> None:
        """Keeps the series under its name, in place of what stood there, whole or not at all.

        Raises:
            InputError: If it has no name or no samples, values that are not finite, or times that nanoseconds do not tell apart,
                or if the server cannot take it.
        """
        times, values = _points(telemetry)
        self._check_names(telemetry.name)
        version, about = self._describe(telemetry, values)
        tags = dict(self.location.tags) | {_CHANNEL: _as_tag(telemetry.name), _VERSION: version}
        begin = f"{escape(self.location.measurement, ', ')}{_tag_set(tags)} {escape(self.location.field)}="
        for first in range(0, len(values), self.batch_size):
            # the float64 of a float32 is exact, and so is its shortest decimal form
            batch = zip(*(array[first : first + self.batch_size].tolist() for array in (values, times)), strict=True)
            self.server.send("\n".join([f"{begin}{value!r} {time_ns}" for value, time_ns in batch]))
        text = about.replace("\\", "\\\\").replace('"', '\\"')
        key = {"key": self._hash(telemetry.name), "store": self._hash()}
        self.server.send(f'{_ABOUT}{_tag_set(key)} about="{text}" {_ABOUT_NS}')
        rows = self.server.ask(f"{self.server.points()} {self._filter({_CHANNEL: tags[_CHANNEL]})} |> first()")
        for old in {row[_VERSION] for row in rows if _VERSION in row and _tags_of(row) == tags | {_VERSION: row[_VERSION]}} - {version}:
            if _IS_VERSION.fullmatch(old):  # not the tag of somebody else that happens to have this name
                self.server.delete(f'{_VERSION}="{old}"')

    def read(self, name: str) -> Telemetry:
        """The series kept under `name`.

        Raises:
            InputError: If there is none, or if samples are missing from it, or if the server cannot be asked.
        """
        about = self._about(name)
        described = Telemetry(np.empty(0, np.float32), **{key: about[key] for key in _DESCRIBED})
        found, pieces, num_samples = 0, [described.values], about["num_samples"]
        for times, values in self.server.stream(self._of_series(name, about), FIRST_NS, LAST_NS):
            as_expected = nanoseconds(described, found, min(found + len(times), num_samples))
            agree = np.append(times[: len(as_expected)] == as_expected, False).argmin()  # how many at the beginning
            with np.errstate(over="ignore"):  # those of others may be beyond float32
                pieces.append(values[:agree].astype(np.float32))
            found += agree
            if agree < len(times):
                break
        if found < num_samples:
            raise InputError(
                f"Expected {num_samples:,} samples of {name!r}. Received: a gap before sample {found}. Write the series again."
            )
        return dataclasses.replace(described, values=np.concatenate(pieces))

    def names(self) -> list[str]:
        """The names of the series kept here, sorted."""
        return sorted(self._abouts())

    # -- what a database can do besides --------------------------------------------------------------------------------

    def check(self) -> None:
        """Asks for nothing, to see whether the server can be asked.

        Raises:
            InputError: If it does not answer, does not know the token, or has no such organisation or bucket.
        """
        self.server.ask(f"{self.server.points(0, 1)} |> limit(n: 1)")

    def versions(self) -> dict[str, str]:
        """The hash of each series kept here by its name: the same for the same series."""
        return {name: about[_VERSION] for name, about in sorted(self._abouts().items())}

    def chunks(
        self, name: str | None = None, start_ns: int | None = None, stop_ns: int | None = None
    ) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """The points of a series as they are stored, in the order of time, some ten thousand at once, however many there are.

        Args:
            name: A series that `write` kept; None for the one, of whoever wrote it, that the location describes.
            start_ns: Nanoseconds since 1970 from which on; None for the first.
            stop_ns: Nanoseconds since 1970 before which; None for behind the last.

        Yields:
            Times in nanoseconds since 1970 (int64) and values (float64), of the same length.

        Raises:
            InputError: If there is no such series, or more than one, or none of numbers, or if the server cannot be asked.
        """
        start = FIRST_NS if start_ns is None else max(int(start_ns), FIRST_NS)
        stop = LAST_NS if stop_ns is None else min(int(stop_ns), LAST_NS)
        if name is not None:
            chosen = self._of_series(name, self._about(name))
        else:
            self._check_one_series()
            chosen = self._filter()
        yield from self.server.stream(chosen, start, stop)

    # -- what stands where ---------------------------------------------------------------------------------------------

    def _check_names(self, name: str) -> None:
        """Refuses what line protocol cannot say, and the tags that are ours."""
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

    def _describe(self, telemetry: Telemetry, values: np.ndarray) -> tuple[str, str]:
        about = {key: getattr(telemetry, key) for key in _DESCRIBED} | {"num_samples": len(values), "location": str(self.location)}
        about |= {key: float(about[key]) for key in ("interval_s", "offset_s")}
        version = hashlib.sha256(json.dumps(about).encode() + values.tobytes()).hexdigest()[:16]
        return version, json.dumps(about | {_VERSION: version})

    def _hash(self, *names: str) -> str:
        return hashlib.sha256(json.dumps([str(self.location), *names]).encode()).hexdigest()[:16]

    def _abouts(self, *names: str) -> dict[str, dict[str, Any]]:
        """Descriptions by name: of all series, or of the one that is named."""
        which = f'r.key == "{self._hash(*names)}"' if names else f'r.store == "{self._hash()}"'
        steps = f'|> filter(fn: (r) => r._measurement == "{_ABOUT}" and r._field == "about" and {which}) |> keep(columns: ["_value"])'
        rows = self.server.ask(f"{self.server.points(_ABOUT_NS, _ABOUT_NS + 1)} {steps}")
        return {about["name"]: about for about in (_description(row.get("_value")) for row in rows)}

    def _about(self, name: str) -> dict[str, Any]:
        about = self._abouts(name).get(name)
        if about is None:
            raise InputError(f"Expected a series of this store: {', '.join(self.names()) or 'it is empty'}. Received: {name!r}.")
        return about

    def _filter(self, tags: dict[str, str] | None = None) -> str:
        place = self.location
        wanted = {"_measurement": place.measurement, "_field": place.field} | dict(place.tags) | (tags or {})
        return f"|> filter(fn: (r) => {' and '.join(f'r[{quote(key)}] == {quote(value)}' for key, value in wanted.items())})"

    def _of_series(self, name: str, about: dict[str, Any]) -> str:
        return self._filter({_CHANNEL: _as_tag(name), _VERSION: about[_VERSION]})

    def _check_one_series(self) -> None:
        rows = self.server.ask(f"{self.server.points()} {self._filter()} |> first()", _SHOWN)
        apart = [tuple(sorted(_tags_of(row).items())) for row in rows]
        if len(apart) > 1:
            differ = [pairs for pairs in apart if set(pairs) - set.intersection(*map(set, apart))] or apart
            shown = " or ".join(str(dataclasses.replace(self.location, tags=pairs)) for pairs in differ[:3])
            raise InputError(f"Expected one series at {self.location}. Received: several. Name one by its tags: {shown}.")
        if not apart:
            raise InputError(self._what_is_missing())

    def _what_is_missing(self) -> str:
        place = self.location
        wanted = [("_measurement", place.measurement), ("_field", place.field), *place.tags]
        for number, (key, value) in enumerate(wanted):
            such = " and ".join(f"r[{quote(tag)}] == {quote(name)}" for tag, name in wanted[:number]) or "true"
            query = (
                f'import "influxdata/influxdb/schema" schema.tagValues(bucket: {quote(place.bucket)}, tag: {quote(key)}, '
                f"predicate: (r) => {such}, start: time(v: {FIRST_NS}), stop: time(v: {LAST_NS}))"
            )
            known = sorted(str(row["_value"]) for row in self.server.ask(query) if row["_value"] not in (None, _ABOUT))
            if value not in known:
                what = {"_measurement": f"a measurement of bucket {place.bucket!r}", "_field": f"a field of {place.measurement!r}"}
                shown = ", ".join(known[:_SHOWN]) + (" and more" if len(known) > _SHOWN else "") if known else "there is none"
                return f"Expected {what.get(key, f'a value of tag {key!r}')}: {shown}. Received: {value!r}. Name one that is there."
        return f"Expected points at {place}. Received: none with all of these tags. Leave one out or correct it."


def _points(telemetry: Telemetry) -> tuple[np.ndarray, np.ndarray]:
    """Times and values of a series that can be kept."""
    check_telemetry(telemetry)
    if not telemetry.name or not len(telemetry):
        raise InputError(f"Expected a series with a name and samples. Received: {len(telemetry)} samples, name={telemetry.name!r}.")
    values = np.ascontiguousarray(telemetry.values, np.float32)
    bad = np.flatnonzero(~np.isfinite(values))
    if len(bad):
        raise InputError(
            f"Expected finite values. Received: {values[bad[0]]} at sample {bad[0]}, which InfluxDB cannot keep. Fill or cut it."
        )
    times = nanoseconds(telemetry)
    if (np.diff(times) <= 0).any():
        raise InputError(f"Expected samples at least a nanosecond apart. Received: interval_s={telemetry.interval_s!r}. Check the unit.")
    return times, values


def _description(text: Any) -> dict[str, Any]:
    """What `write` said of a series.

    Raises:
        InputError: If it is something else: somebody else can write there too.
    """
    try:
        about = json.loads(text)
        is_good = all(isinstance(about[key], str) for key in ("name", "unit", _VERSION)) and isinstance(about["start"], str | None)
        is_good = is_good and all(type(about[key]) is float and np.isfinite(about[key]) for key in ("interval_s", "offset_s"))
        is_good = is_good and type(about["num_samples"]) is int and 1 <= about["num_samples"] < 2**53
    except (ValueError, TypeError, KeyError, RecursionError):
        is_good = False
    if not is_good:
        raise InputError(f"Expected descriptions of series as they were written. Received: {str(text)[:80]!r}. Write the series again.")
    return about


def _tags_of(row: Mapping[str, Any]) -> dict[str, str]:
    """The tags of a row of an answer: what is neither its time, its value nor where it stands."""
    return {key: value for key, value in row.items() if not key.startswith("_") and key not in ("result", "table")}


def _encode(part: str) -> str:
    return urllib.parse.quote(part, safe="")


def _as_tag(name: str) -> str:
    """A name as the value of a tag: what InfluxDB does not take there is percent-encoded."""
    return "".join(sign if sign.isprintable() and sign not in "%\\" else urllib.parse.quote(sign) for sign in name)


def _tag_set(tags: dict[str, str]) -> str:
    return "".join(f",{escape(key)}={escape(value)}" for key, value in sorted(tags.items()))
