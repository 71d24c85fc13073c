"""Mutations of inputs as bytes, as text, and as JSON structures. Equal generators make equal mutations."""

import copy
import json
import random

NASTY_TEXT = (
    "", " ", ".", "..", "../../x", "/etc/passwd", "a/b", "a\\b", "CON", "nul.", "x" * 300, "\x00", "\n", "\r\n", "\x1b[31m", "\u202e", "\ud800",
    "é", "漢字", "<script>alert(1)</script>", "'\";--", "{}", "[]", "null", "nan", "NaN", "inf", "-inf", "1e999", "-0", "1" * 400, "0x10",
    "1_000", "٣", "1,5", "1.500,0", "1970-01-01", "9999-12-31T23:59:60Z", "0001-01-01", "2024-02-30", "2024-10-27 02:30:00", "24:00",
    "=", ":", "%", "%00", "%ff", "&", "?", "#", "stuck", "1:2:3", "+1", "1e-400", "true", "*a", "&a", "!!python/object:os.system", "- ", "\t",
    '"', '""', ",,,,", ";", "|", "time", "Europe/Berlin", "%Y", "P1D", "2024-W01-1", "-9223372036854775808", "18446744073709551616",
)  # fmt: skip
NASTY_NUMBERS = (
    0, -1, 1, 2, 0.5, -0.0, 1e-320, 1e308, 10**9, 10**10, 10**12, 2**31, 2**63, 2**64, 10**30, 10**400, -(10**18), float("nan"), float("inf"), -float("inf"),
)  # fmt: skip
NASTY_JSON = (None, True, False, [], {}, [[]], [None], {"": None}, [0] * 50, "x", *NASTY_NUMBERS, *NASTY_TEXT)


def change_bytes(data: bytes, rng: random.Random, others: list[bytes]) -> bytes:
    """Mutates bytes: flips bits, changes values, and drops, repeats or inserts pieces."""
    data = bytearray(data)
    for _ in range(rng.choice((1, 1, 2, 4, 8))):
        place = rng.randrange(len(data) + 1)
        length = rng.choice((1, 2, 4, 8, rng.randrange(1, 200)))
        kind = rng.randrange(8)
        if kind == 0 and data:
            data[place % len(data)] ^= 1 << rng.randrange(8)
        elif kind == 1 and data:
            data[place % len(data)] = rng.choice((0, 1, 9, 10, 32, 34, 44, 45, 127, 128, 255, rng.randrange(256)))
        elif kind == 2:
            value = rng.choice((0, 1, -1, 2**15, 2**31 - 1, -(2**31), 2**40, 2**63 - 1, rng.randrange(2**32)))
            data[place : place + 8] = (value % 2**64).to_bytes(8, rng.choice(("little", "big")))[: rng.choice((1, 2, 4, 8))]
        elif kind == 3:
            del data[place : place + length]
        elif kind == 4:
            data[place:place] = data[place : place + length] * rng.choice((1, 2, 20))
        elif kind == 5:
            other = rng.choice(others)
            begin = rng.randrange(len(other) + 1)
            data[place : place + length] = other[begin : begin + length]
        elif kind == 6:
            data[place:place] = rng.choice(NASTY_TEXT).encode("utf-8", "surrogatepass")
        else:
            del data[rng.randrange(len(data) + 1) :]
            data += rng.randbytes(rng.randrange(8))
    return bytes(data)


def change_text(data: bytes, rng: random.Random, others: list[bytes]) -> bytes:
    """Mutates text: replaces words and numbers, and repeats or drops lines."""
    text = data.decode("utf-8", "replace")
    for _ in range(rng.choice((1, 1, 2, 3))):
        kind = rng.randrange(5)
        cuts = [place for place, letter in enumerate(text) if letter in ",;:\n /=&?[]{}-|\t"] + [len(text)]
        cut = rng.choice(cuts)
        end = next((place for place in cuts if place > cut), len(text))
        if kind == 0:
            text = text[: cut + 1] + rng.choice(NASTY_TEXT) + text[end:]
        elif kind == 1:
            text = text[: cut + 1] + str(rng.choice(NASTY_NUMBERS)) + text[end:]
        elif kind == 2:
            text = text[:cut] + text[cut:end] * rng.choice((2, 3, 30)) + text[end:]
        elif kind == 3:
            text = text[:cut] + text[end:]
        else:
            place = rng.randrange(len(text) + 1)
            text = text[:place] + rng.choice(NASTY_TEXT) + text[place:]
    return text.encode("utf-8", "surrogatepass")


def change_json(data: bytes, rng: random.Random, others: list[bytes]) -> bytes:
    """Mutates JSON so that it stays valid JSON: replaces, drops or repeats entries."""
    try:
        content = [json.loads(data)]
    except (ValueError, RecursionError):
        return rng.choice(others)
    for _ in range(rng.choice((1, 1, 1, 2, 3))):
        places = list(_places(content))
        parent, key = rng.choice(places[: rng.choice((3, 30, len(places)))])
        kind = rng.randrange(8)
        if kind <= 3:
            parent[key] = copy.deepcopy(rng.choice(NASTY_JSON))
        elif kind == 4:
            other, elsewhere = rng.choice(places)
            parent[key] = json.loads(json.dumps(other[elsewhere]))
        elif kind == 5 and parent is not content:
            del parent[key]
        elif kind == 6:
            value = parent[key]
            if isinstance(value, list):
                value += value[: rng.choice((1, 2, 50))]
            elif isinstance(value, dict):
                value[rng.choice(NASTY_TEXT)] = copy.deepcopy(rng.choice(NASTY_JSON))
            elif isinstance(value, int | float) and not isinstance(value, bool):
                parent[key] = value * rng.choice((-1, 2, 10, 1e3, 1e9))
            else:
                parent[key] = str(value) + rng.choice(NASTY_TEXT)
        else:
            for _ in range(rng.choice((2, 40))):
                parent[key] = rng.choice(([parent[key]], {"a": parent[key]}))
    return json.dumps(content[0]).encode()


def _places(parent):
    for key in range(len(parent)) if isinstance(parent, list) else list(parent):
        yield parent, key
        if isinstance(parent[key], list | dict):
            yield from _places(parent[key])
