"""Options of `mesh_problem` that a deck says, by parts of the mesh that are named for it.

Whatever acts on nodes, faces or elements becomes a named part and an option of this name.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from enumsol.errors import InvalidArgumentError

if TYPE_CHECKING:
    from collections.abc import Iterator

    from enumsol.decks.cards import DeckPlace
    from enumsol.decks.model import ContactPair, Deck, Material, Section
    from enumsol.decks.states import DeckState
    from enumsol.fem.deck_joints import DeckJoints
    from enumsol.fem.deck_parts import DeckParts
    from enumsol.support.array_types import Floats, Integers

#: Options that are given by sets of elements.
_BY_MATERIAL = ("young", "poisson", "orthotropic", "orientation", "density", "expansion", "thickness")
#: Families of plane elements, and what `mesh_problem` calls them.
_PLANES = {"plane strain": "strain", "plane stress": "stress", "axisymmetric": "axisymmetric"}


# -- the same in all steps -------------------------------------------------------------------------------------------


def shared(deck: Deck, parts: DeckParts) -> dict[str, Any]:
    """Options that are the same in all steps: materials; contacts are looked at.

    Raises
    ------
    InvalidArgumentError
        A material or a contact is not what is known here.
    """
    _check_contacts(deck, parts)
    return _materials(deck, parts)


def _materials(deck: Deck, parts: DeckParts) -> dict[str, Any]:
    """Elastic constants and their axes, density and thickness by sets of elements, and the plane."""
    found: dict[str, dict[str, Any]] = {name: {} for name in _BY_MATERIAL}
    for section, rows in elastic_sections(deck):
        name = parts.elements(rows, section.elements)
        material = deck.materials[section.material]
        if not material.elastic:
            raise material.place.refused(f"*MATERIAL {material.name} has no *ELASTIC; expected an elastic law")
        if material.elastic == "ISO":
            found["young"][name], found["poisson"][name] = map(float, material.constants)
        else:
            found["orthotropic"][name] = _engineering_constants(material)
            if section.orientation:
                found["orientation"][name] = axes_of_section(deck, section)
        expansion = () if material.expansion is None else material.expansion.tolist()
        if len(expansion) > 1:
            raise material.expansion_place.refused(
                f"*EXPANSION of {material.name} has {len(expansion)} coefficients; expected one"
            )
        found["expansion"][name] = expansion[0] if expansion else 0.0
        if material.density:
            found["density"][name] = material.density
        found["thickness"][name] = section.thickness or 1.0
    options: dict[str, Any] = {name: found[name] for name in _BY_MATERIAL[:4] if found[name]}
    warmed = any(act.card == "TEMPERATURE" for step in deck.steps for act in step.acts)
    if warmed and any(found["expansion"].values()):
        options["expansion"] = found["expansion"]
    if found["density"].keys() == found["expansion"].keys():
        options["density"] = found["density"]
    if deck.dimension == 2:
        options["plane"] = _planes(deck, parts)
    if set(found["thickness"].values()) != {1.0} and options.get("plane", "axisymmetric") != "axisymmetric":
        options["thickness"] = found["thickness"]
    return options


def _engineering_constants(material: Material) -> list[float]:
    """E1, E2, E3, nu12, nu13, nu23, G12, G13, G23 of an orthotropic material."""
    if material.elastic == "ENGINEERING CONSTANTS":
        return list(map(float, material.constants))
    d11, d12, d22, d13, d23, d33, *shear = map(float, material.constants)
    moduli = np.array([[d11, d12, d13], [d12, d22, d23], [d13, d23, d33]])
    if min(np.linalg.eigvalsh(moduli)) <= 0 or min(shear) <= 0:
        raise material.elastic_place.refused(
            f"*ELASTIC of {material.name} gives no positive energy for some strains; expected D1111, D1122, D2222, "
            "D1133, D2233, D3333, D1212, D1313, D2323 that do"
        )
    flexible = np.linalg.inv(moduli)
    young = 1 / np.diag(flexible)
    poisson = [-flexible[i, j] * young[i] for i, j in ((0, 1), (0, 2), (1, 2))]
    return [*map(float, young), *map(float, poisson), *shear]


def axes_of_section(deck: Deck, section: Section) -> list[float]:
    """Directions of the first two axes of the material of a section.

    Raises
    ------
    InvalidArgumentError
        It names no orientation, or one whose axes turn within an element.
    """
    said = f"*SOLID SECTION names the orientation {section.orientation}"
    given = section.place.entry(deck.orientations, section.orientation, said)
    if given.system != "RECTANGULAR":
        raise given.place.refused(
            f"*ORIENTATION is {given.system.lower()}, with axes that turn within an element; expected "
            "SYSTEM=RECTANGULAR for an orthotropic material"
        )
    first, second = given.points - given.origin
    third = np.cross(first, second)
    axes = np.array([own / np.linalg.norm(own) for own in (first, np.cross(third, first), third)])
    if given.rotation:
        k, angle = given.rotation[0] - 1, np.radians(given.rotation[1])
        one, two = axes[(k + 1) % 3].copy(), axes[(k + 2) % 3].copy()
        axes[(k + 1) % 3] = np.cos(angle) * one + np.sin(angle) * two
        axes[(k + 2) % 3] = np.cos(angle) * two - np.sin(angle) * one
    return [*map(float, axes[0]), *map(float, axes[1])]


def elastic_sections(deck: Deck) -> list[tuple[Section, Integers]]:
    """Sections of bodies with the rows of their elements.

    Raises
    ------
    InvalidArgumentError
        An element has none or two of them, or one of another kind or without a material.
    """
    bodies = np.concatenate([np.full(len(block.labels), deck.is_body(block)) for block in deck.blocks])
    found, without = [], bodies.copy()
    for section in deck.sections:
        rows = deck.elements_of(section.elements, section.place)
        rows = rows[bodies[rows]]
        if not len(rows):
            continue
        if section.kind != "SOLID SECTION":
            raise section.place.refused(f"*{section.kind} is of solid elements; expected *SOLID SECTION")
        section.place.entry(deck.materials, section.material, f"*SOLID SECTION names the material {section.material}")
        if not np.all(without[rows]):
            again = deck.element_name(int(rows[np.argmin(without[rows])]))
            raise section.place.refused(
                f"*SOLID SECTION holds element {again}, which has one already; expected one material for every element"
            )
        found.append((section, rows))
        without[rows] = False
    if np.any(without):
        first = int(np.argmax(without))
        raise InvalidArgumentError(
            f"{deck.path}: element {deck.element_name(first)} and {int(np.sum(without)) - 1} others have no *SOLID "
            "SECTION; expected a material for every element"
        )
    return found


def _planes(deck: Deck, parts: DeckParts) -> Any:
    """Plane of all cells, or of each by sets of elements."""
    rows: dict[str, list[Integers]] = {}
    for first, block in zip(deck.firsts, deck.blocks, strict=False):
        if deck.is_body(block):
            rows.setdefault(_PLANES[block.type.family], []).append(first + np.arange(len(block.labels)))
    if len(rows) == 1:
        return next(iter(rows))
    return {parts.elements(np.concatenate(own), f"plane {name}"): name for name, own in rows.items()}


def _check_contacts(deck: Deck, parts: DeckParts) -> None:
    """Refuse contacts between what there is not."""
    if not deck.pairs:
        raise InvalidArgumentError(f"{deck.path} has no *CONTACT PAIR; expected contact")
    for pair in deck.pairs:
        for name in (pair.slave, pair.master):
            parts.check_surface(name, pair.place, "CONTACT PAIR", faced=name == pair.master)
        said = f"*CONTACT PAIR names the interaction {pair.interaction or 'nothing'}"
        pair.place.entry(deck.interactions, pair.interaction, said)
        if isinstance(pair.adjust, str):
            deck.nodes_of(pair.adjust, pair.place)
    if not _touching(deck, 0):
        raise deck.pairs[0].place.refused("all surfaces of *CONTACT PAIR are tied; expected contact")


def _touching(deck: Deck, step: int) -> list[ContactPair]:
    """Pairs of surfaces that may touch in a step: not tied, and not taken out of contact by then."""
    removed: dict[tuple[str, str], bool] = {}
    for own in deck.steps[:step]:
        removed |= {pair: not there for pair, there in own.contacts.items()}
    apart = [pair for pair in deck.pairs if not (pair.tied or deck.interactions[pair.interaction].tied)]
    return [pair for pair in apart if not removed.get((pair.slave, pair.master), False)]


def contacts(deck: Deck, step: int) -> dict[str, Any]:
    """Options for the pairs that may touch in a step (0: before the first), and their coefficients of friction.

    Raises
    ------
    InvalidArgumentError
        There are none, or a surface has two coefficients.
    """
    touching = _touching(deck, step)
    if not touching:
        place = deck.steps[step - 1].place
        raise place.refused(f"no pair is in contact in step {step}; expected one, or --step")
    pairs = [(pair.slave, pair.master, *([] if pair.clearance is None else [pair.clearance])) for pair in touching]
    return {"pairs": pairs, "friction": _friction(deck, touching, step)}


def _friction(deck: Deck, touching: list[ContactPair], step: int) -> dict[str, float]:
    """Coefficients of friction in a step, by surfaces."""
    found: dict[str, float] = {}
    for pair in touching:
        value = deck.interactions[pair.interaction].friction
        for own in deck.steps[:step]:
            value = own.friction.get(pair.interaction, value)
        if found.setdefault(pair.slave, value) != value:
            raise pair.place.refused(
                f"the surface {pair.slave} has friction {value:g} here and {found[pair.slave]:g} in another pair; "
                "expected one coefficient for each first surface"
            )
    return found


# -- what acts in a step ---------------------------------------------------------------------------------------------


def acting(deck: Deck, parts: DeckParts, state: DeckState, joints: DeckJoints) -> dict[str, Any]:
    """Options for what is given at the end of a step.

    Raises
    ------
    InvalidArgumentError
        It cannot be given to a body here.
    """
    joints.check_grounds(state)
    bodies, points = _on_nodes(deck, parts, state, joints, "BOUNDARY")
    forces, loads = _on_nodes(deck, parts, state, joints, "CLOAD")
    d, turns = joints.dimension, joints.dimension * (joints.dimension - 1) // 2
    for name in dict.fromkeys(joints.points.values()):
        given = points.get(name, {})
        held = {d + k: 0.0 for k in range(turns)} if name not in joints.rigid else {}
        if given or held:
            bodies[name] = [{**held, **given}.get(k) for k in range(d + turns)]
    moments: dict[str, Any] = {}
    for name, given in loads.items():
        if any(k < d for k in given):
            forces[name] = [given.get(k, 0.0) for k in range(d)]
        if any(k >= d for k in given):
            moments[name] = [given.get(d + k, 0.0) for k in range(turns)] if d == 3 else given[d]
    options = {
        "displacement": bodies,
        "force": forces,
        "moment": moments,
        "pressure": _pressures(deck, parts, state),
        "body_force": _volume_forces(deck, parts, state),
        "centrifugal": _centrifugal(deck, parts, state),
        "temperature": _temperatures(deck, parts, state),
    }
    return {name: value for name, value in options.items() if value}


def _on_nodes(
    deck: Deck, parts: DeckParts, state: DeckState, joints: DeckJoints, kind: str
) -> tuple[dict[str, list[Any]], dict[str, dict[int, float]]]:
    """Displacements or forces by sets of nodes to which a line gives the same; and of reference points.

    The first by components, the second by entries, of which rotations are the last.
    """
    dimension, free = joints.dimension, None if kind == "BOUNDARY" else 0.0
    of_lines: dict[DeckPlace, dict[int, dict[int, float]]] = {}
    points: dict[str, dict[int, float]] = {}
    for (node, component), value in state.of(kind).items():
        row, number = int(node), int(component)
        place = state.place((kind, node, component))
        slot = joints.slot(row, number)
        entry = number - 1 if slot is None else slot[1]
        if entry < 0 or (slot is None and number > dimension):
            if value:
                what = "moves" if kind == "BOUNDARY" else "loads"
                raise place.refused(
                    f"*{kind} {what} node {deck.node_name(row)} in component {number}; expected components 1 to "
                    f"{dimension}, or rotations of the reference node of a rigid body"
                )
        elif slot is not None:
            points.setdefault(slot[0], {})[entry] = value
        else:
            of_lines.setdefault(place, {}).setdefault(row, {})[entry] = value
    found: dict[str, list[Any]] = {}
    names = {rows.tobytes(): name for name, rows in reversed(deck.node_sets.items())}
    for place, given, rows in _groups(of_lines):
        parts.told_of_loose(rows, kind, place)
        inside = parts.in_bodies(rows)
        if len(inside):
            wanted = names.get(inside.tobytes(), f"{kind.lower()} of line {place.line}")
            name = parts.nodes(inside, wanted) if kind == "BOUNDARY" else parts.exactly(inside, wanted)
            for k, value in given:
                found.setdefault(name, [free] * dimension)[k] = value
    return found, points


def _groups(
    of_lines: dict[DeckPlace, dict[int, dict[int, float]]],
) -> list[tuple[DeckPlace, tuple[tuple[int, float], ...], Integers]]:
    """Nodes to which a line gives the same, with what it gives them; lines of single nodes together."""
    groups: dict[Any, tuple[DeckPlace, list[int]]] = {}
    for place, nodes in of_lines.items():
        for row, own in nodes.items():
            given = tuple(sorted(own.items()))
            groups.setdefault((given, place if len(nodes) > 1 else None), (place, []))[1].append(row)
    return [(place, given, np.unique(rows)) for (given, _), (place, rows) in groups.items()]


def _pressures(deck: Deck, parts: DeckParts, state: DeckState) -> dict[str, float]:
    """Pressures by surfaces."""
    groups: dict[tuple[DeckPlace, float], list[tuple[int, int]]] = {}
    for (element, label), value in state.of("DLOAD").items():
        if str(label).startswith("P") and value:
            face = int(str(label)[1:]) - 1
            place = state.place(("DLOAD", element, label))
            groups.setdefault((place, value), []).append((int(element), face))
    found = {}
    for (place, value), faces in groups.items():
        rows = np.array(faces, dtype=np.int64)
        found[parts.faces(rows, f"pressure of line {place.line}", place)] = value
    return found


def _temperatures(deck: Deck, parts: DeckParts, state: DeckState) -> list[float]:
    """Changes of temperature of all nodes of the deck since it was free of stress; none where nothing expands."""
    given = state.of("TEMPERATURE")
    if not given:
        return []
    used = [deck.materials[section.material].expansion for section, _ in elastic_sections(deck)]
    if not any(np.any(expansion) for expansion in used if expansion is not None):
        parts.told(state.place(next(key for key in state.terms if key[0] == "TEMPERATURE")), "TEMPERATURE",
                   "not used: no material has *EXPANSION")  # fmt: skip
        return []
    change = np.zeros(len(deck.points))
    cold = state.of("INITIAL CONDITIONS")
    for (node, _), value in given.items():
        change[int(node)] = value - cold.get((node, 0), 0.0)
    return change.tolist()


def _volume_forces(deck: Deck, parts: DeckParts, state: DeckState) -> dict[str, list[float]]:
    """Forces per volume by sets of elements: gravity by the density of each material, and those that are given."""
    dimension = deck.dimension
    total: dict[int, Floats] = {}
    for _, axis, weight, rows in _by_mass(deck, state, "GRAV"):
        for row in rows:
            total[row] = total.get(row, np.zeros(3)) + weight * axis
    for (element, label), value in state.of("DLOAD").items():
        if str(label).startswith("B"):
            total[int(element)] = total.get(int(element), np.zeros(3)) + value * np.eye(3)["XYZ".index(str(label)[1])]
    groups: dict[tuple[float, ...], list[int]] = {}
    for row, force in total.items():
        groups.setdefault(tuple(force.tolist()), []).append(row)
    found = {}
    for vector, elements in groups.items():
        if any(vector[dimension:]):
            raise InvalidArgumentError(f"{deck.path}: a force per volume acts across the plane of plane elements")
        found[parts.elements(np.array(elements), "volume force")] = list(vector[:dimension])
    return found


def _by_mass(deck: Deck, state: DeckState, kind: str) -> Iterator[tuple[DeckPlace, Floats, float, list[int]]]:
    """Lines of a load by mass, with the numbers of its field, its size times the density, and elements of a material.

    Raises
    ------
    InvalidArgumentError
        A material has no density.
    """
    for (target, field), value in state.of(kind).items():
        place = state.place((kind, target, field))
        wanted = deck.elements_of(str(target), place) if target else np.arange(len(deck.element_labels))
        for section, rows in elastic_sections(deck):
            density = deck.materials[section.material].density
            own = np.intersect1d(rows, wanted)
            if len(own) and density is None:
                raise place.refused(
                    f"*DLOAD has {kind} on elements of {section.material}, which has no *DENSITY; expected one"
                )
            numbers = np.array([float(part) for part in str(field).split()])
            yield place, numbers, value * (density or 0.0), own.tolist()


def _centrifugal(deck: Deck, parts: DeckParts, state: DeckState) -> dict[str, list[float]]:
    """Centrifugal forces by sets of elements: density times speed squared, a point on the axis, and its direction."""
    found: dict[str, list[float]] = {}
    turning: dict[int, DeckPlace] = {}
    for place, axis, force, rows in _by_mass(deck, state, "CENTRIF"):
        again = next((row for row in rows if row in turning), None)
        if again is not None:
            raise place.refused(
                f"*DLOAD has CENTRIF on element {deck.element_name(again)}, as {turning[again]} has already; expected "
                "one axis for every element"
            )
        turning |= dict.fromkeys(rows, place)
        if rows:
            found[parts.elements(np.array(rows), "rotation")] = [force, *axis.tolist()]
    return found
