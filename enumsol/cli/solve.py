"""``enumsol solve``: from a mesh to all solutions."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from enumsol.cli.common import GALLERY, TOML, load_any_problem, note, parse_alpha, refuse_misspelt
from enumsol.cli.options import LIMITS, OUTPUT, JsonFile, MaxNodes, Quiet
from enumsol.cli.roots import (
    CsvFile,
    HowExact,
    Jobs,
    ProofFile,
    Resume,
    StopAfter,
    TimeLimit,
    answer,
    check_files,
)
from enumsol.errors import InvalidArgumentError

if TYPE_CHECKING:
    from enumsol.model.problem import ContactProblem
    from enumsol.model.problem3d import ContactProblem3D

_BODY, _SUPPORT, _LOAD = "Body and contact", "Supports", "Loads"


def _text(name: str, metavar: str, text: str, panel: str) -> Any:
    return typer.Option(name, metavar=metavar, help=text, rich_help_panel=panel, show_default=False)


Part = Annotated[list[str] | None, _text("--contact", "NAME", "Part in contact; may be repeated.", _BODY)]
Young = Annotated[str | None, _text("--young", "E", "Young's modulus [force / length^2].", _BODY)]
Poisson = Annotated[str | None, _text("--poisson", "NU", "Poisson's ratio.", _BODY)]
Plane = Annotated[
    Literal["strain", "stress"] | None, _text("--plane", "strain|stress", "In 2D; default: strain.", _BODY)
]
Friction = Annotated[
    str | None, _text("--friction", "F0[,F1]", "Coefficient F0 + alpha F1; default 0,1: alpha itself.", _BODY)
]
Friction2 = Annotated[str | None, _text("--friction2", "F0[,F1]", "In 3D, along the second axis.", _BODY)]
Axis = Annotated[str | None, _text("--axis", "x,y,z", "In 3D, direction of the first axis of friction.", _BODY)]
Gap = Annotated[str | None, _text("--gap", "LENGTH", "Initial gap; negative is a press fit.", _BODY)]
Obstacle = Annotated[
    str | None,
    _text(
        "--obstacle",
        "KIND=NUMBERS",
        "plane=x,y,nx,ny (normal towards the body), circle=x,y,r, hole=x,y,r; in 3D plane=x,y,z,nx,ny,nz, "
        "sphere=x,y,z,r, hole=x,y,z,r. Default: the contact part itself, moved by the gap.",
        _BODY,
    ),
]
Groups = Annotated[str | None, _text("--groups", "NAME", "Cell data that groups facets, without names.", _BODY)]
Clamp = Annotated[list[str] | None, _text("--clamp", "NAME", "Part that is held; may be repeated.", _SUPPORT)]
Symmetry = Annotated[
    list[str] | None, _text("--symmetry", "NAME", "Part on a plane of symmetry, or on rollers.", _SUPPORT)
]
Displacement = Annotated[
    list[str] | None,
    _text("--displacement", "NAME=ux,uy[,uz]", "Given displacements; `free` for a component that is not.", _SUPPORT),
]
Spring = Annotated[
    list[str] | None, _text("--spring", "NAME=kn,kt", "Springs per area along the normal and across it.", _SUPPORT)
]
Load = Annotated[
    list[str] | None, _text("--load", "NAME=fx,fy[,fz]", "Force per area (in 2D per length, unit thickness).", _LOAD)
]
LoadSlope = Annotated[list[str] | None, _text("--load-slope", "NAME=fx,fy[,fz]", "The same, times alpha.", _LOAD)]
Pressure = Annotated[list[str] | None, _text("--pressure", "NAME=P", "Force per area into the body.", _LOAD)]
PressureSlope = Annotated[list[str] | None, _text("--pressure-slope", "NAME=P", "The same, times alpha.", _LOAD)]
BodyForce = Annotated[str | None, _text("--body-force", "fx,fy[,fz]", "Force per volume, such as the weight.", _LOAD)]
AtAlpha = Annotated[
    str | None,
    _text(
        "--alpha",
        "NUMBER",
        "Parameter value, a number or a fraction such as 8/3; needed where friction or load depend on it.",
        LIMITS,
    ),
]
Output = Annotated[
    str | None,
    typer.Option(
        "--output",
        "-o",
        metavar="FILE",
        help="Write the problem, for the other commands: .npz, .h5, or a new directory.",
        rich_help_panel=OUTPUT,
    ),
]


def solve(
    mesh: Annotated[
        str,
        typer.Argument(
            metavar="MESH", help="A mesh with named parts (.msh, .vtu, ...), or a .toml file.", show_default=False
        ),
    ],
    contact: Part = None,
    young: Young = None,
    poisson: Poisson = None,
    plane: Plane = None,
    friction: Friction = None,
    friction2: Friction2 = None,
    axis: Axis = None,
    gap: Gap = None,
    obstacle: Obstacle = None,
    groups: Groups = None,
    clamp: Clamp = None,
    symmetry: Symmetry = None,
    displacement: Displacement = None,
    spring: Spring = None,
    load: Load = None,
    load_slope: LoadSlope = None,
    pressure: Pressure = None,
    pressure_slope: PressureSlope = None,
    body_force: BodyForce = None,
    alpha: AtAlpha = None,
    arithmetic: HowExact = "verified",
    stop_after: StopAfter = None,
    max_nodes: MaxNodes = None,
    time_limit: TimeLimit = None,
    jobs: Jobs = 1,
    proof_file: ProofFile = None,
    resume: Resume = False,
    json_file: JsonFile = None,
    csv_file: CsvFile = None,
    output: Output = None,
    quiet: Quiet = False,
) -> None:
    """Make a contact problem of MESH and find all its solutions.

    A .toml file holds the same options by the same names (`load_slope`, not `--load-slope`), and `mesh`. All other
    commands take such files as PROBLEM, and what --output writes. Without --alpha a problem that depends on alpha is
    written, not solved.

    Exit status: as enumsol roots.
    """
    given = {
        "contact": contact,
        "young": _number(young, "--young"),
        "poisson": _number(poisson, "--poisson"),
        "plane": plane,
        "friction": _one_or_two(friction, "--friction"),
        "friction2": _one_or_two(friction2, "--friction2"),
        "axis": _numbers(axis, "--axis"),
        "gap": _number(gap, "--gap"),
        "obstacle": _by_part([obstacle] if obstacle else None, "--obstacle"),
        "groups": groups,
        "clamp": clamp,
        "symmetry": symmetry,
        "displacement": _by_part(displacement, "--displacement"),
        "spring": _by_part(spring, "--spring"),
        "load": _by_part(load, "--load"),
        "load_slope": _by_part(load_slope, "--load-slope"),
        "pressure": _by_part(pressure, "--pressure", single=True),
        "pressure_slope": _by_part(pressure_slope, "--pressure-slope", single=True),
        "body_force": _numbers(body_force, "--body-force"),
    }
    check_files(proof_file, json_file, csv_file, resume=resume)
    value = None if alpha is None else parse_alpha(alpha)
    problem = _problem(mesh, {name: entry for name, entry in given.items() if entry is not None})
    if _at_rest(problem):
        note("nothing acts on the body: it has no load, press fit or given displacement, and rests")
    if output is not None:
        _write(problem, output)
    if value is None and problem.depends_on_alpha:
        if output is not None:
            return
        raise InvalidArgumentError("--alpha is missing, on which friction or load depend; expected it, or --output")
    limits: dict[str, Any] = {"stop_after": stop_after, "max_nodes": max_nodes, "time_limit": time_limit}
    options = {"arithmetic": arithmetic, "proof_path": proof_file, "resume": resume, **limits}
    answer(mesh, problem, value or 0.0, jobs, options, json_file, csv_file)


def _problem(mesh: str, options: dict[str, Any]) -> ContactProblem | ContactProblem3D:
    if mesh.endswith(TOML):
        if options:
            name = next(iter(options)).replace("_", "-")
            raise InvalidArgumentError(f"--{name} is given beside {mesh}, which has all options; expected it there")
        return load_any_problem(mesh)
    from enumsol import fem  # numpy: not for --help
    from enumsol.fem.mesh_problems import check_keys
    from enumsol.io import SUFFIXES
    from enumsol.support.arguments import file_path
    from enumsol.support.files import unreadable

    place = file_path(mesh, "MESH", "the name of a mesh file")
    if place.suffix in SUFFIXES or mesh.startswith(GALLERY):
        raise InvalidArgumentError(f"{mesh} is a problem; expected a mesh (enumsol roots {mesh} solves a problem)")
    refuse_misspelt(mesh, meshes=True)
    if (found := unreadable(place)) is not None:
        raise InvalidArgumentError(f"{mesh}: {found}; expected a mesh with named parts, or a {TOML} file")
    check_keys(options, lambda name: "--" + name.replace("_", "-"))
    return fem.mesh_problem(mesh, **options)


def _at_rest(problem: ContactProblem | ContactProblem3D) -> bool:
    """Whether u = 0 solves the problem because it has no data that are not zero, for every alpha."""
    acting = [problem.f, problem.load_slope, problem.slip_offset]
    return not any(part is not None and part.any() for part in acting) and not (problem.gap < 0).any()


def _write(problem: ContactProblem | ContactProblem3D, place: str) -> None:
    from enumsol.io import write_problem  # as above

    write_problem(problem, place)
    note(f"wrote a problem with {problem.n} degrees of freedom and {problem.p} contact nodes to {place}")


def _by_part(texts: list[str] | None, option: str, *, single: bool = False) -> dict[str, Any] | None:
    """Values by the names of parts, of texts NAME=VALUES."""
    if texts is None:
        return None
    found: dict[str, Any] = {}
    for text in texts:
        name, sign, numbers = text.rpartition("=")
        if not sign or not name:
            raise InvalidArgumentError(f"{option} is {text}; expected NAME=NUMBERS")
        if name in found:
            raise InvalidArgumentError(f"{option} is given twice for {name}; expected it once")
        found[name] = _number(numbers, option) if single else _numbers(numbers, option)
    return found


def _numbers(text: str | None, option: str) -> list[Any] | None:
    return None if text is None else [_entry(part, option, text) for part in text.split(",")]


def _one_or_two(text: str | None, option: str) -> Any:
    numbers = _numbers(text, option)
    return numbers[0] if numbers is not None and len(numbers) == 1 else numbers


def _number(text: str | None, option: str) -> Any:
    return None if text is None else _entry(text, option, text)


def _entry(part: str, option: str, text: str) -> Any:
    if part.strip() == "free" and option == "--displacement":
        return "free"
    try:
        return float(part)
    except ValueError:
        raise InvalidArgumentError(f"{option} is {text}; expected numbers such as 0.5, with commas between") from None
