"""Mutants of real proofs: their bytes, their text, their JSON and their numbers changed, under a right checksum."""

import base64
import json
import re
import struct
import zlib
from fractions import Fraction
from functools import reduce
from math import isfinite
from operator import getitem

from proof_tools import MAGIC, copied, multipliers, put, sealed, with_multipliers

HUGE = (
    *("1e4000000", "1e400", "-1e400", "9" * 5000, "9" * 3999, "1/0", "0/0", "1/" + "3" * 4001),
    *("nan", "inf", " 1", "1_0"),
)
TEXTS = (
    *HUGE, "", "0", "-1", "6" * 9, "\ud800", "\u0663", "AAAA", "AAAAAA==", "x", "s", "c", "graph", "problem",
    "condensed",
)  # fmt: skip
NUMBERS = (
    0, 1, -1, 2, 5, 6, 7, 10**9, 2**31, 2**63, -(2**63), 10**17, 10**30, 10**400, 1e300, -1e300, 1e308, 5e-324, 0.5,
    True,
)  # fmt: skip
#: What JSON takes and a proof does not.
LITERALS = (
    *("NaN", "Infinity", "-Infinity", "1e999", "-1e999", "1E400"),
    *("[" * 3000 + "]" * 3000, "[" * 100_000, '{"a":1,"a":1}'),
)
FLOATS = (1e300, -1e300, 1.7e308, float("inf"), float("-inf"), float("nan"), 0.0, -0.0, 5e-324, 1e-300)
_HOLE = "\u0001hole"


def mutant(rng, records, data, ways=None):
    """One mutant of a proof, given by its records and its bytes, and the name of the mutation, one of all or these."""
    how = str(rng.choice(list(ways or _MUTATIONS)))
    return _MUTATIONS[how](rng, records, data), how


def _lines(records):
    return [json.dumps(record, separators=(",", ":")) for record in records]


def _sealed_lines(lines, level=1):
    return sealed(zlib.compress("".join(line + "\n" for line in lines).encode("utf-8", "surrogatepass"), level))


def _pick(rng, items):
    return items[int(rng.integers(len(items)))]


# -- bytes -------------------------------------------------------------------------------------------------------------


def _file(rng, _, data):
    """The file itself, checksum and all."""
    from enumsol import Proof

    changed = bytearray(data)
    how = int(rng.integers(4))
    if how == 0:
        changed[int(rng.integers(len(changed)))] ^= 1 << int(rng.integers(8))
    elif how == 1:
        del changed[int(rng.integers(len(changed))) :]
    elif how == 2:
        changed += rng.bytes(int(rng.integers(1, 80)))
    else:
        changed *= 2
    return Proof(bytes(changed))


def _stream(rng, _, data):
    """The compressed stream under a checksum that fits."""
    body = bytearray(data[len(MAGIC) : -32])
    how = int(rng.integers(5))
    at = int(rng.integers(len(body)))
    if how == 0:
        body[at] ^= 1 << int(rng.integers(8))
    elif how == 1:
        del body[at:]
    elif how == 2:
        del body[at : at + int(rng.integers(1, 20))]
    elif how == 3:
        body *= 2
    else:
        body[at:at] = rng.bytes(int(rng.integers(1, 20)))
    return sealed(bytes(body))


# -- text --------------------------------------------------------------------------------------------------------------


def _characters(rng, records, _):
    """A few characters of the text."""
    text = bytearray("".join(line + "\n" for line in _lines(records)).encode())
    for _ in range(int(rng.integers(1, 4))):
        at = int(rng.integers(len(text)))
        how = int(rng.integers(4))
        if how == 0:
            text[at] = int(rng.integers(256))
        elif how == 1:
            text[at : at + 1] = bytes([_pick(rng, b'0123456789-+eE.,"[]{}:/ \n')])
        elif how == 2:
            del text[at : at + int(rng.integers(1, 12))]
        else:
            text[at:at] = text[at : at + int(rng.integers(1, 40))]
    return sealed(zlib.compress(bytes(text), 1))


def _order(rng, records, _):
    """Lines left out, repeated, exchanged, cut off."""
    lines = _lines(records)
    at, other = (int(k) for k in rng.integers(len(lines), size=2))
    how = int(rng.integers(6))
    if how == 0:
        del lines[at]
    elif how == 1:
        lines.insert(at, lines[other])
    elif how == 2:
        lines[at], lines[other] = lines[other], lines[at]
    elif how == 3:
        del lines[at:]
    elif how == 4:
        lines[at] = lines[other]
    else:
        lines += lines[at:]
    return _sealed_lines(lines)


# -- JSON --------------------------------------------------------------------------------------------------------------


def _places(value, path=()):
    """Paths to all values within a record."""
    yield path
    if isinstance(value, list | dict):
        keys = range(len(value)) if isinstance(value, list) else value
        for key in keys:
            yield from _places(value[key], (*path, key))


def _field(rng, records, _):
    """One value anywhere in a record, by another of the same or of another kind."""
    # the header, the end and the records between them alike
    at = _pick(rng, (0, -1, int(rng.integers(len(records))), int(rng.integers(len(records)))))
    path = _pick(rng, list(_places(records[at])))
    old = copied(reduce(getitem, path, records[at]))
    how = int(rng.integers(6))
    if how == 0:
        new = _pick(rng, NUMBERS)
    elif how == 1:
        new = _pick(rng, TEXTS)
    elif how == 2:
        new = _pick(rng, (None, [], {}, [old], {"a": old}, [old] * 3, [[]], [[[old]]], False))
    elif how == 3:
        new = _nudged(rng, old)
    elif how == 4:
        new = copied(reduce(getitem, _pick(rng, list(_places(records[at]))), records[at]))
    else:
        lines = _lines(put(records, (at, *path), _HOLE))
        lines[at] = lines[at].replace(json.dumps(_HOLE), _pick(rng, LITERALS))
        return _sealed_lines(lines)
    return _sealed_lines(_lines(put(records, (at, *path), new)))


def _nudge(rng, records, _):
    """One number, text or list slightly otherwise."""
    at = int(rng.integers(len(records)))
    path = _pick(rng, list(_places(records[at])))
    return _sealed_lines(_lines(put(records, (at, *path), lambda old: _nudged(rng, old))))


def _nudged(rng, old):
    if isinstance(old, bool) or old is None:
        return not old
    if isinstance(old, int):
        return old + int(rng.integers(-3, 4))
    if isinstance(old, float):
        return _pick(rng, (-old, 2 * old, old * 1e300, old / 2, 0.0, old * (1 + 1e-9), 1e308))
    if isinstance(old, str):
        at = int(rng.integers(len(old) + 1))
        head, tail = old[:at], old[at + 1 :]
        return _pick(rng, (head + tail, head + "5" + old[at:], old + old, head + "0" + tail))
    if isinstance(old, list):
        at = int(rng.integers(len(old) + 1))
        return _pick(rng, (old[:at], old + old, old[::-1], old[:at] + old[at + 1 :], old * 50))
    keys = list(old)
    return {key: old[key] for key in keys if key != _pick(rng, keys)}


def _numbers(rng, records, _):
    """Multipliers."""
    changed = copied(records)
    lists = [k for k, record in enumerate(changed) if isinstance(record, list) and record]
    # the rows of those of 3D are a list, which the mutations of fields reach
    texts = {k: [isinstance(part, str) for part in changed[k][1:3]] for k in lists}
    places = [k for k in lists if changed[k][0] == "x" and len(texts[k]) == 2 and all(texts[k])]
    if not places:
        return _nudge(rng, records, _)
    at = _pick(rng, places)
    rows, values = multipliers(changed[at])
    for _ in range(int(rng.integers(1, 3))):
        how = int(rng.integers(7))
        j = int(rng.integers(len(values))) if values else 0
        if how == 0 and values:
            values[j] = _pick(rng, FLOATS)
        elif how == 1 and values:
            values[j] *= float(_pick(rng, (-1.0, 0.5, 2.0, 1e6, 1e-6, 1 + 1e-9)))
        elif how == 2 and rows:
            rows[j] = int(_pick(rng, (0, 1, 7, 20, 10**6, 2**32 - 1)))
        elif how == 3:
            rows, values = rows * 40, values * 40
        elif how == 4 and values:
            del values[j], rows[j]
        elif how == 5:
            values = [v * 1e300 for v in values]
        else:
            values = [-v for v in values]
    changed[at] = with_multipliers(changed[at], rows, values)
    if rng.random() < 0.1:
        text = base64.b64encode(struct.pack("<3I", 1, 2, 3)).decode()
        changed[at][1] = _pick(rng, (text, text[:-1], text + "=", text + "\u00e9", 5, None))
    return _sealed_lines(_lines(changed))


# -- bombs -------------------------------------------------------------------------------------------------------------


def _bomb(rng, records, _):
    """A line or a part of one very often, compressed as far as it goes."""
    lines = _lines(records)
    at = int(rng.integers(len(lines)))
    count = int(10 ** rng.uniform(2, 5.3))
    how = int(rng.integers(6))
    if how == 0:
        lines[at:at] = [lines[int(rng.integers(len(lines)))]] * count
    elif how == 1:
        short = "[]", "{}", '["u",""]', '["n"]', '["p","1"]', '["s"]', '["b",0,[0,5]]', "null", "", " "
        lines[at:at] = [_pick(rng, short)] * count
    elif how == 2:
        lines[at] = "[" + ",".join([_pick(rng, ("0", "[]", '""', "{}", '"0/1"'))] * count) + "]"
    elif how == 3:
        lines[at] = '["u","' + "a" * count + '"]'
    elif how == 4:
        lines[at] = lines[at].replace("[", "[" * min(count, 5000), 1)
    else:
        lines[at] += " " * count
    return _sealed_lines(lines, level=9)


_MUTATIONS = {
    **{"file": _file, "stream": _stream, "characters": _characters, "order": _order},
    **{"field": _field, "field again": _field, "nudge": _nudge, "numbers": _numbers, "bomb": _bomb},
}


# -- one number after the other ----------------------------------------------------------------------------------------


def each_number(records):
    """The records with one number that is another one: (place, record).

    Numbers, fractions, codes, and rows and multipliers in base64; others are of other signs and sizes, zero, very
    near, repeated or left out.
    """
    p = records[0]["p"]
    for place, record in enumerate(records):
        for path in _places(record):
            for new in _others(reduce(getitem, path, record), record, path):
                yield place, put([record], (0, *path), new)[0]
        for rows, values in _other_multipliers(record, p):
            yield place, with_multipliers(record, rows, values)


def _others(old, record, path):
    """Other values of a number or a text that stands for one."""
    if type(old) is int:
        beside = reduce(getitem, path[:-1], record) if path else []
        found = {*range(9), old - 1, old + 1, -old, 10**9, 2**31, 2**63}
        found |= {x for x in beside if type(x) is int} if isinstance(beside, list) else set()
        yield from sorted(found - {old})
    elif type(old) is float:
        yield from (x for x in _sizes(old) if x != old and isfinite(x))
    elif isinstance(old, str) and re.fullmatch(r"-?[0-9a-f]{1,200}(/[0-9a-f]{1,200})?", old):
        base = 16 if isinstance(record, list) and record[0] == "D" else 10
        if base == 10 and not re.fullmatch(r"[-0-9/]+", old):
            return  # a fingerprint
        value = Fraction(*(int(part, base) for part in old.split("/")))
        others = (-value, 2 * value, value / 2, value + 1, value + Fraction(1, 10**30), Fraction(0))
        yield from (_fraction(x, base, "/" in old) for x in others if x != value)
        yield from (
            old[:i] + code + old[i + 1 :] for i in range(min(len(old), 6)) for code in "012345678" if base == 10
        )


def _sizes(x):
    return (-x, 0.0, x * (1 + 1e-9), x / 2, 2 * x, 1e3 * x, 1e-3 * x, x + 1.0, x - 1.0, 1e6, 1e300, -1e300, 5e-324)


def _fraction(value, base, slash):
    sign, above = "-" if value < 0 else "", abs(value.numerator)
    digits = f"{above:x}/{value.denominator:x}" if base == 16 else f"{above}/{value.denominator}"
    return sign + (digits if slash or value.denominator > 1 else str(above))


def _other_multipliers(record, p):
    """Other rows and multipliers in the place of those of a record, if it has some in base64."""
    if not isinstance(record, list) or record[0] != "x" or not isinstance(record[1], str):
        return
    rows, values = multipliers(record)
    for j, (row, value) in enumerate(zip(rows, values, strict=True)):
        for other in (*_sizes(value), float("inf"), float("nan")):
            yield rows, [*values[:j], other, *values[j + 1 :]]
        for other in {*range(7 * p + 1), 2**32 - 1} - {row}:
            yield [*rows[:j], other, *rows[j + 1 :]], values
        yield [*rows, row], [*values, value]
        yield rows[:j] + rows[j + 1 :], values[:j] + values[j + 1 :]
