"""Mutants of proofs in 3D for the judge, and where the judge and the checker disagree."""

from contextlib import suppress

import proof_fuzz
import space_graph_proofs
import space_proofs
from proof_fuzz import _pick
from proof_tools import bytes_of, copied, of_kind, proof_of
from space_judge import Refused, Undecided, judge

from enumsol import NotHeldError, ProofFormatError, verify


def _number(rng, records):
    """A number of a certificate, a box or a form."""
    places = of_kind(records, "a", "l", "q", "r")
    if places:
        record = records[_pick(rng, places)]
        lists = [part for part in record[1:] if isinstance(part, list) and part and isinstance(part[0], float)]
        if lists:
            part = _pick(rng, lists)
            j = int(rng.integers(len(part)))
            x = part[j]
            part[j] = float(_pick(rng, (-x, 2 * x, x / 2, 0.0, x * (1 + 1e-6), x + 10.0 ** int(rng.integers(-12, 1)))))


def _named(rng, records):
    """The codes or the index of a certificate."""
    places = of_kind(records, "a", "l")
    if places:
        record = records[_pick(rng, places)]
        codes = [part for part in record[1:] if isinstance(part, list) and part and isinstance(part[0], int)]
        if codes and rng.random() < 0.7:
            j = int(rng.integers(len(codes[0])))
            codes[0][j] = int(_pick(rng, (codes[0][j] + int(rng.integers(-2, 3)), *range(7), 12)))
        else:
            place = 5 if record[0] == "a" else 6
            record[place] = int(_pick(rng, (-record[place], 0, 2)))


def _referred(rng, records):
    """What is said of the root of a body that nothing holds: rows, products, their factors, and its form."""
    places = of_kind(records, "o", "q")
    record = records[_pick(rng, places)]
    if record[0] == "q":
        part = int(rng.integers(1, 4))
        if part > 2:
            j, more = int(rng.integers(len(record[3]))), record[3]
            more[j] = float(_pick(rng, (0.0, -more[j], 2 * more[j], 1e-3 * more[j])))
        else:
            j = int(rng.integers(len(record[part])))
            record[part][j] = _pick(rng, (record[part][int(rng.integers(len(record[part])))], -record[part][j]))
        return
    rows, products = record[2:]
    how = int(rng.integers(6))
    if how == 0:
        del rows[int(rng.integers(len(rows)))]
    elif how == 1:
        row = _pick(rng, rows)
        row[int(rng.integers(3))] += int(_pick(rng, (-1, 1, 3)))
    elif how == 2:
        _pick(rng, products)[2] *= float(_pick(rng, (-1.0, 0.0, 1e-3, 0.5, 2.0, 1e3)))
    elif how == 3:
        products.append([copied(_pick(rng, rows)), copied(_pick(rng, rows)), 1.0])
    elif how == 4:
        row = _pick(rng, products)[int(rng.integers(2))]
        row[int(rng.integers(3))] += int(_pick(rng, (-1, 1, 2)))
    else:
        products.clear()


def _moved(rng, records):
    """A record left out, written twice, or in the place of another one."""
    j, k = (int(i) for i in rng.integers(1, len(records) - 1, 2))
    how = int(rng.integers(4))
    if how == 0:
        del records[j]
    elif how == 1:
        records.insert(k, copied(records[j]))
    elif how == 2:
        records[j], records[k] = records[k], records[j]
    else:
        records[j] = copied(records[k])


def _cut_short(rng, records):
    """A subtree that is said to be one leaf, with counts that fit."""
    places = of_kind(records, "b")
    if places:
        k = _pick(rng, places)
        waiting, end = 1, k
        while waiting and end < len(records) - 1:
            record = records[end]
            waiting += len(record[2]) - 1 if record[0] == "b" else -1 if record[0] != "q" else 0
            end += 1
        donors = [records[j] for j in range(k, end) if records[j][0] in ("x", "n", "a", "o")] + [["n"], ["u", ""]]
        records[k:end] = [copied(_pick(rng, donors))]
        _counted(records)


def _counted(records):
    """Leaves and undecided parts as they are."""
    leaves = [record for record in records[1:-1] if record[0] not in ("b", "q")]
    records[-1]["leaves"], records[-1]["undecided"] = len(leaves), len([x for x in leaves if x[0] == "u"])


def _recounted(rng, records):
    """A claim changed with counts that fit, the number of roots as well."""
    places = of_kind(records, "x", "n", "r", "l", "u", "z", "a", "o")
    k = _pick(rng, places)
    before = records[k][0]
    records[k] = _pick(rng, (["n"], ["u", ""], copied(records[_pick(rng, places)])))
    solved = ("r", "a", "l")
    records[-1]["roots"] += (records[k][0] in solved) - (before in solved) if rng.random() < 0.7 else 0
    _counted(records)


_OWN = [
    *space_proofs._OWN.values(),
    *[_number] * 3,
    _named,
    *[_referred] * 4,
    *[_moved] * 2,
    *[_cut_short] * 2,
    *[_recounted] * 2,
]


def mutant(rng, records, data, general=0.1):
    """One mutant of a proof and the name of the mutation."""
    if rng.random() < general:
        how = str(rng.choice(space_proofs._GENERAL))
        return proof_fuzz._MUTATIONS[how](rng, records, data), how
    changed, names = copied(records), []
    for _ in range(int(rng.integers(1, 3))):
        change = _pick(rng, _OWN)
        names.append(change.__name__)
        # a proof may have nothing of this kind
        with suppress(ValueError, IndexError, KeyError, TypeError):
            change(rng, changed)
    return proof_of(changed), " ".join(names)


def without_arcs(records):
    """A graph that is not cut into arcs."""
    found, skipped = [], False
    for record in records:
        skipped = record == {"parts": True} or (skipped and isinstance(record, list))
        if not skipped:
            found.append(record)
    return [*found[:-1], {**found[-1], "arcs": None}]


def _places_of_parts(records):
    """Where the records of parts are."""
    found, inside = [], False
    for k, record in enumerate(records):
        inside = record == {"parts": True} or (inside and isinstance(record, list))
        if inside and isinstance(record, list):
            found.append(k)
    return found


def _part(rng, records):
    """A part of a curve that is of another kind, elsewhere, left out, or with other boxes and places."""
    places = _places_of_parts(records)
    k, other = _pick(rng, places), _pick(rng, places)
    special = [j for j in places if records[j][0] != "s"]
    k = _pick(rng, special) if special and rng.random() < 0.7 else k
    record = records[k]
    how = int(rng.integers(7))
    if how == 0:
        del records[k]
    elif how == 1:
        records[k] = copied(records[other])
    elif how == 2:
        records[k] = ["u", None]
    elif how == 3:
        record[0] = str(_pick(rng, ("s", "f", "c", "h", "u")))
    elif how == 4 and len(record) > 3:
        record[2], record[3] = record[3], record[2]
    elif how == 5:
        j = int(rng.integers(1, len(record)))
        record[j] = None if record[j] else copied(_pick(rng, [x for x in records if x[0] == "w"]))
    else:
        boxes = [x for x in record[1:] if isinstance(x, list)]
        part = _pick(rng, boxes)[int(rng.integers(1, 5))]
        j = int(rng.integers(len(part)))
        part[j] += float(rng.normal()) * 10.0 ** int(rng.integers(-12, 0))


def _count(rng, records):
    key = _pick(rng, ("curves", "arcs", "leaves", "gaps"))
    records[-1][key] = None if rng.random() < 0.2 else records[-1][key] + int(_pick(rng, (-1, 1)))


def mutant_of_graph(rng, records):
    """One mutant of a graph's proof, of its arcs or of the rest, and the name of the mutation."""
    if not _places_of_parts(records) or rng.random() < 0.6:
        return space_graph_proofs.mutant(rng, without_arcs(records))
    changed = copied(records)
    change = _pick(rng, (_part, _part, _part, _moved, _count))
    with suppress(ValueError, IndexError, KeyError, TypeError):
        change(rng, changed)
    return proof_of(changed), change.__name__


def checked(problem, proof):
    """What the checker says: counts or None, and why not."""
    try:
        report = verify(problem, proof)
    except (ProofFormatError, NotHeldError) as error:
        return None, f"format: {error}"
    return (report if report.ok else None), "; ".join(report.failures)


def judged(problem, proof):
    """What the judge says: counts or None, and why not."""
    try:
        return judge(problem, bytes_of(proof)), ""
    except Undecided as error:
        return None, f"undecided: {error}"
    except Refused as error:
        return None, str(error)
