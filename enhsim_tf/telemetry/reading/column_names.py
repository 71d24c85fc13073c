"""What the name of a column says: its words, whether it speaks of a clock, and in which unit."""

import re

from enhsim_tf.telemetry.cleaning.options import UNITS

_TIMES = set(
    "time times timestamp timestamps datetime date dates epoch elapsed simtime tout unix unixtime "
    "utc utcg posix ts clock mjd jd datenum uptime yyyymmdd hhmm hhmmss "
    "seconds secs millis milliseconds microseconds nanoseconds minutes hours days zeit zeitstempel "
    "zeitpunkt datum uhrzeit sekunden "
    "temps heure horodatage tiempo fecha hora tempo tijd".split()
)
BESIDE = set(
    "since start of run the from local gmt cet sim simulation simulated mission rel relative abs "
    "absolute system sample sampling event log logger "
    "record recorded received created at in begin boot experiment test server day julian "
    "modified excel serial number "
    "step ref reference header stamp end stop".split()
)
_ENDS = set("end ende stop finish until bis to fin hasta tot".split())  # of an interval
_KEYS = set(
    "host hostname sensor sensorid device deviceid node tag tagname channel channelname parameter "
    "param signal variable metric field series measurement point pointname station machine asset "
    "entity source location site name id copy table result item object unit".split()
)
UNIT_OF = {word: unit for unit, words in UNITS.items() for word in words.split()}
_DAY_WORDS = ("mjd", "jd", "datenum")


def words_of(name: str) -> list[str]:
    """Splits the name of a column into words of small letters; capitals in the middle begin a word,
    as in `OPCQuality`.
    """
    split = re.sub(r"(?<=[a-z])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z]{2})", " ", name)
    return [word.casefold() for word in re.findall(r"[^\W\d_]+", split)]


def is_unnamed(name: str) -> bool:
    """Whether a column has no name, as the index of a pandas object that was saved."""
    return bool(re.fullmatch(r"column 0|Unnamed: \d+|level_0", name))


def name_tells(name: str) -> tuple[int, str | None]:
    """Returns how clearly a name speaks of a clock (2 clearly, 1 as `t` does, 0 not), and the unit
    or kind of days that it states.
    """
    # of LabVIEW, scopes and TensorBoard
    if re.fullmatch(r"x_value(?:\.\d+)?|x-axis|wall time", name.casefold().strip()):
        return 2, None
    words = words_of(name)
    unit = next((UNIT_OF[word] for word in reversed(words) if word in UNIT_OF), None)
    unit = next((word for word in words if word in _DAY_WORDS), unit)
    bracket = bool(re.search(r"[(\[/]\s*[^\W\d_]+\s*[)\]]?\s*$", name))
    if re.fullmatch(r"\W*t\W*", name):
        return 1, None
    if len(words) == 2 and words[0] in ("t", "x"):
        return (2, unit) if unit and bracket else (0, None)
    is_known = all(word in _TIMES or word in BESIDE or word in UNIT_OF for word in words)
    return (2, unit) if is_known and any(word in _TIMES for word in words) else (0, None)


def mentions_time(name: str) -> bool:
    """Whether a name has a word of time among others."""
    return not _TIMES.isdisjoint(words_of(name))


def tells_time_of(signal: str, name: str) -> bool:
    """Whether a name says no more than that of a signal and that it is a time, as `volts_time`
    beside `volts` and `time2` beside any.
    """
    own = [word for word in words_of(name) if word not in words_of(signal)]
    is_of_one = len(words_of(name)) > 1 or any(map(str.isdigit, name))
    return is_of_one and len(own) == 1 and own[0] in _TIMES.union("t")


def without_ends(names: list[str]) -> list[str]:
    """Leaves out the ends of intervals beside their beginnings."""
    return [name for name in names if _ENDS.isdisjoint(words_of(name))] or names


def names_series(name: str) -> bool:
    """Whether a name is one of what tells series apart, such as a sensor or its place."""
    words = words_of(name)
    return bool(words) and (words[-1] in _KEYS or "".join(words) in _KEYS) and words[0] in _KEYS
