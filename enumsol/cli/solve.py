"""``enumsol solve``: from a mesh to all solutions."""

from __future__ import annotations

from inspect import Parameter, signature
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

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
    from collections.abc import Callable

    from enumsol.model.problem import ContactProblem
    from enumsol.model.problem3d import ContactProblem3D

_BODY, _SUPPORT, _LOAD = "Body and contact", "Supports", "Loads"


class Given(NamedTuple):
    """How an option of `fem.mesh_problem` is given on the command line.

    Attributes
    ----------
    panel, metavar, help : in the help
    read : function of the text, or of the texts, and the option's name
    repeated : whether it may be given several times
    """

    panel: str
    metavar: str
    help: str
    read: Callable[[Any, str], Any]
    repeated: bool = False


Part = Annotated[
    list[str] | None, _text("--contact", "NAME", "Part of the boundary in contact; may be repeated.", _BODY)
]
Young = Annotated[str | None, _text("--young", "E", "Young's modulus [force / length^2].", _BODY)]
Poisson = Annotated[str | None, _text("--poisson", "NU", "Poisson's ratio.", _BODY)]
Plane = Annotated[
    Literal["strain", "stress"] | None,
    _text("--plane", "strain|stress", "In 2D, plane strain or plane stress; default: strain.", _BODY),
]
Friction = Annotated[
    str | None,
    _text(
        "--friction", "F0[,F1]", "Coefficient of friction F0 + alpha F1; default: 0,1, which is alpha itself.", _BODY
    ),
]
Friction2 = Annotated[
    str | None, _text("--friction2", "F0[,F1]", "In 3D, coefficient of friction along the second axis.", _BODY)
]
Axis = Annotated[str | None, _text("--axis", "x,y,z", "In 3D, direction of the first axis of friction.", _BODY)]
Gap = Annotated[str | None, _text("--gap", "LENGTH", "Initial gap; negative is a press fit.", _BODY)]
Obstacle = Annotated[
    str | None,
    _text(
        "--obstacle",
        "KIND=NUMBERS",
        "plane=x,y,nx,ny (normal towards the body), circle=x,y,r, hole=x,y,r; in 3D plane=x,y,z,nx,ny,nz, "
        "sphere=x,y,z,r, hole=x,y,z,r. Default: the contact part itself, moved by the gap.",
        _obstacle,
    ),
]
Groups = Annotated[
    str | None,
    _text(
        "--groups", "NAME", "Name of the cell data that groups the facets, for a file without names of parts.", _BODY
    ),
]
Clamp = Annotated[list[str] | None, _text("--clamp", "NAME", "Part that is held; may be repeated.", _SUPPORT)]
Symmetry = Annotated[
    list[str] | None, _text("--symmetry", "NAME", "Part on a plane of symmetry, or on rollers.", _SUPPORT)
]
Displacement = Annotated[
    list[str] | None,
    _text(
        "--displacement",
        "NAME=ux,uy[,uz]",
        "Prescribed displacements; `free` for a component that is not prescribed.",
        _SUPPORT,
    ),
]
Spring = Annotated[
    list[str] | None,
    _text("--spring", "NAME=kn,kt", "Springs per area, along the normal and along the tangents.", _SUPPORT),
]
Load = Annotated[
    list[str] | None, _text("--load", "NAME=fx,fy[,fz]", "Force per area (in 2D per length and unit thickness).", _LOAD)
]
LoadSlope = Annotated[list[str] | None, _text("--load-slope", "NAME=fx,fy[,fz]", "The same, times alpha.", _LOAD)]
Pressure = Annotated[list[str] | None, _text("--pressure", "NAME=P", "Force per area into the body.", _LOAD)]
PressureSlope = Annotated[list[str] | None, _text("--pressure-slope", "NAME=P", "The same, times alpha.", _LOAD)]
BodyForce = Annotated[str | None, _text("--body-force", "fx,fy[,fz]", "Force per volume, such as the weight.", _LOAD)]
AtAlpha = Annotated[
    str | None,
    typer.Option(
        "--alpha",
        "NUMBER",
        "Parameter value: a number, or a fraction such as 8/3; required if friction or load depend on it.",
        LIMITS,
    ),
]
Output = Annotated[
    str | None,
    typer.Option(
        "--output",
        "-o",
        metavar="FILE",
        help="Write the problem for the other commands: .npz, .h5, or a new directory.",
        rich_help_panel=OUTPUT,
    ),
]


@_with_mesh_options
def solve(
    mesh: Annotated[
        str,
        typer.Argument(
            metavar="MESH", help="A mesh with named parts (.msh, .vtu, ...), or a .toml file.", show_default=False
        ),
    ],
    *,
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
    **texts: Any,
) -> None:
    """Build a contact problem from MESH and find all its solutions.

    A .toml file holds the same options under the same names (`load_slope`, not `--load-slope`), and `mesh`. All other
    commands accept such files as PROBLEM, and also the files that --output writes. Without --alpha, a problem that
    depends on alpha is written but not solved.

    Exit status: as enumsol roots.
    """
    given = {
        name: MESH_OPTIONS[name].read(text, "--" + name.replace("_", "-"))
        for name, text in texts.items()
        if text is not None
    }
    check_files(proof_file, json_file, csv_file, resume=resume)
    value = None if alpha is None else parse_alpha(alpha)
    problem = _problem(mesh, given)
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
