"""Cards of constraints: equations, couplings, rigid bodies, springs, and directions of components."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

from enumsol.decks.cards import is_number, key
from enumsol.decks.registry import card
from enumsol.decks.steps import Coupling, NodalEquation, Spring, Transform
from enumsol.support.messages import counted

if TYPE_CHECKING:
    from enumsol.decks.cards import Card
    from enumsol.decks.registry import Reading


@card("EQUATION")
def equation(reading: Reading, given: Card) -> str:
    """*EQUATION: the number of terms, then a node, a component and a coefficient of each, several in a line."""
    rows, count, at = [*given.rows()], 0, 0
    while at < len(rows):
        row, entries = rows[at]
        wanted = given.integer(entries[0] if entries else "", row)
        terms: list[tuple[str, int, float]] = []
        at += 1
        while len(terms) < wanted:
            if at == len(rows):
                raise given.refused(f"has {len(terms)} of {wanted} terms; expected all of them", row)
            line, own = rows[at]
            if not own or len(own) % 3:
                raise given.refused(f"has {len(own)} entries in a line; expected 3 for each term", line)
            for node, component, coefficient in zip(own[::3], own[1::3], own[2::3], strict=True):
                of = node if is_number(node) else key(node)
                terms.append((of, given.integer(component, line), given.number(coefficient, line)))
            at += 1
        if len(terms) != wanted or wanted < 1:
            raise given.refused(f"has {len(terms)} terms; expected {wanted}", row)
        reading.analysis.equations.append(NodalEquation(given.at(row), tuple(terms)))
        count += 1
    return counted(count, "linear equation")


@card("MPC")
def mpc(reading: Reading, given: Card) -> str:
    """*MPC: those of Abaqus that say that nodes move together; others need large displacements."""
    for row, entries in given.rows():
        kind = key(entries[0]) if entries else ""
        if kind not in ("TIE", "PIN", "BEAM") or len(entries) != 3:
            raise given.refused(f"is of type {kind}; expected TIE, PIN or BEAM with two nodes, or *EQUATION", row)
        one, two = (entry if is_number(entry) else key(entry) for entry in entries[1:])
        place = given.at(row)
        if kind == "BEAM":
            reading.analysis.couplings.append(Coupling(place, given.name, one, two))
        else:
            reading.analysis.equations += [
                NodalEquation(place, ((one, k, 1.0), (two, k, -1.0)), given.name) for k in (1, 2, 3)
            ]
    return "nodes that move together"


@card("RIGID BODY", "NSET", "ELSET", "TIE NSET", "PIN NSET", "REF NODE", "ROT NODE", "ANALYTICAL SURFACE")
def rigid_body(reading: Reading, given: Card) -> str:
    """*RIGID BODY: nodes or elements that move as one."""
    kinds = ("NSET", "ELSET", "TIE NSET", "PIN NSET", "ANALYTICAL SURFACE")
    target = next((name for option in kinds if (name := given.name_of(option))), "")
    if not target:
        raise given.refused("has no NSET, ELSET or ANALYTICAL SURFACE; expected one")
    reference = given.needed("REF NODE")
    rotation = given.name_of("ROT NODE") or None
    reading.region.couplings.append(Coupling(given.place, given.name, target, reference, rotation))
    return f"{target} moves as a rigid body with node {reference}"


@card("COUPLING", "CONSTRAINT NAME", "REF NODE", "SURFACE", "ORIENTATION")
def coupling(reading: Reading, given: Card) -> str:
    """*COUPLING: the card after it says in which way."""
    if "ORIENTATION" in given.options:
        raise given.refused("has ORIENTATION; expected components along the axes")
    reading.analysis.coupling = Coupling(given.place, given.name, given.needed("SURFACE"), given.needed("REF NODE"))
    return f"{reading.analysis.coupling.target} is coupled to node {reading.analysis.coupling.reference}"


@card("KINEMATIC")
@card("DISTRIBUTING", "WEIGHTING METHOD", unused=("COUPLING",))
def kinematic(reading: Reading, given: Card) -> str:
    """*KINEMATIC and *DISTRIBUTING: whether a surface moves with the reference node, or the node with its mean."""
    own = reading.analysis.coupling
    if own is None:
        raise given.refused("stands without *COUPLING before it; expected that")
    if (weights := given.name_of("WEIGHTING METHOD")) not in ("", "UNIFORM"):
        raise given.refused(f"has WEIGHTING METHOD={weights}; expected UNIFORM")
    found: list[int] = []
    for row, entries in given.rows():
        ends = [given.integer(entry, row) for entry in entries[:2] if entry]
        if not ends or not 1 <= ends[0] <= ends[-1] <= 6:
            raise given.refused(f"has the components {', '.join(entries)}; expected some from 1 to 6", row)
        found += range(ends[0], ends[-1] + 1)
    kind: Literal["kinematic", "distributing"] = "kinematic" if given.name == "KINEMATIC" else "distributing"
    every = tuple(dict.fromkeys(found)) or (1, 2, 3, 4, 5, 6)
    reading.analysis.couplings.append(Coupling(own.place, own.card, own.target, own.reference, None, kind, every))
    reading.analysis.coupling = None
    return f"components {', '.join(map(str, every))}"


@card("SPRING", "ELSET", "NONLINEAR", "DEPENDENCIES", "ORIENTATION")
def spring(reading: Reading, given: Card) -> str:
    """*SPRING: the stiffness of spring elements."""
    elements, rows = given.needed("ELSET"), [*given.rows()]
    if given.options.keys() & {"NONLINEAR", "DEPENDENCIES", "ORIENTATION"}:
        raise given.refused("has NONLINEAR, DEPENDENCIES or ORIENTATION; expected one stiffness")
    if not 1 <= len(rows) <= 2:
        raise given.refused(f"has {len(rows)} lines of data; expected components of nodes, then a stiffness")
    first = rows[0][1] if len(rows) == 2 else []
    components = tuple(given.integer(entry, rows[0][0]) for entry in first if entry)
    row, entries = rows[-1]
    value = given.number(entries[0] if entries else "", row)
    if value < 0:
        raise given.refused(f"has the stiffness {value:g}; expected it >= 0", row)
    reading.analysis.springs.append(Spring(given.place, elements, value, components))
    return f"springs of stiffness {value:g}"


@card("TRANSFORM", "NSET", "TYPE")
def transform(reading: Reading, given: Card) -> str:
    """*TRANSFORM: components of nodes along directions of their own."""
    kind = given.name_of("TYPE") or "R"
    if kind not in ("R", "C"):
        raise given.refused(f"has TYPE={kind}; expected R or C")
    if len(given.data) != 1:
        raise given.refused(f"has {len(given.data)} lines of data; expected six numbers")
    numbers = tuple(given.numbers(0, 6, 6))
    nodes = given.needed("NSET")
    reading.analysis.transforms.append(Transform(given.place, nodes, kind, numbers))
    return f"components of {nodes} are {'cylindrical' if kind == 'C' else 'along axes of their own'}"
