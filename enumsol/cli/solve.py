"""``enumsol solve``: from a mesh to all solutions."""

from __future__ import annotations

from inspect import Parameter
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import typer

from enumsol.cli import common
from enumsol.cli.common import GALLERY, TOML, note, parse_alpha, refuse_misspelt, scene_of, units_of
from enumsol.cli.options import LIMITS, OUTPUT, Argument, OutputFile, OutputFlag, Quiet, options_of, with_options
from enumsol.cli.output import deliver, write_figure
from enumsol.cli.progress import Display
from enumsol.cli.roots import Search
from enumsol.errors import InvalidArgumentError, InvalidProblemError

if TYPE_CHECKING:
    from collections.abc import Callable

    from enumsol.fem.scenes import Scene
    from enumsol.model.problem3d import AnyProblem

_BODY, _SUPPORT, _LOAD = "Body and contact", "Supports", "Loads"


class Given(NamedTuple):
    """An option of `fem.mesh_problem` on the command line.

    Attributes
    ----------
    panel, metavar : in the help; a metavar that begins with NAME= or [NAME=] is of values by parts of the body
    read : function of the text of a value and the option's name
    repeated : whether it may be given several times
    """

    panel: str
    metavar: str
    read: Callable[[str, str], Any]
    repeated: bool = True

    def value(self, given: str | list[str], option: str) -> Any:
        """The option's value, of its text or, if it may be repeated, of its texts."""
        if isinstance(given, str):
            return self.read(given, option)
        if self.metavar.startswith("NAME=") or (self.metavar.startswith("[NAME=]") and "=" in "".join(given)):
            return _by_part(given, option, self.read)
        if not self.metavar.startswith("[NAME=]"):
            return [self.read(text, option) for text in given]
        if len(given) > 1:
            raise InvalidArgumentError(f"{option} is given {len(given)} times; expected one value, or NAME=VALUE each")
        return self.read(given[0], option)


def _by_part(texts: list[str], option: str, read: Callable[[str, str], Any]) -> dict[str, Any]:
    """Values by the names of parts, of texts NAME=VALUE."""
    found: dict[str, Any] = {}
    for text in texts:
        name, sign, value = text.rpartition("=")
        if not sign or not name:
            raise InvalidArgumentError(f"{option} is {text}; expected NAME=NUMBERS")
        if name in found:
            raise InvalidArgumentError(f"{option} is given twice for {name}; expected it once")
        found[name] = read(value, option)
    return found


def _as_given(text: str, option: str) -> str:
    del option
    return text


def _entry(part: str, option: str, text: str) -> Any:
    if part.strip() == "free" and option.startswith("--displacement"):
        return "free"
    try:
        return float(part)
    except ValueError:
        raise InvalidArgumentError(f"{option} is {text}; expected numbers such as 0.5, with commas between") from None


def _number(text: str, option: str) -> Any:
    return _entry(text, option, text)


def _auto_or_number(text: str, option: str) -> Any:
    return text if text == "auto" else _number(text, option)


def _numbers(text: str, option: str) -> list[Any]:
    return [_entry(part, option, text) for part in text.split(",")]


def _plane(text: str, option: str) -> str:
    if text not in ("strain", "stress", "axisymmetric"):
        raise InvalidArgumentError(f"{option} is {text}; expected strain, stress or axisymmetric")
    return text


def _pair(text: str, option: str) -> list[Any]:
    names = text.split(":")
    if len(names) not in (2, 3):
        raise InvalidArgumentError(f"{option} is {text}; expected NAME:NAME, or NAME:NAME:GAP")
    return [*names[:2], *(_entry(gap, option, text) for gap in names[2:])]


def _obstacle(text: str, option: str) -> dict[str, Any]:
    return _by_part([text], option, _numbers)


def _parts(text: str, option: str) -> list[str]:
    del option
    return text.split(",")


def _number_or_numbers(text: str, option: str) -> Any:
    numbers = _numbers(text, option)
    return numbers[0] if len(numbers) == 1 else numbers


def _axes(text: str, option: str) -> dict[str, Any]:
    kind, _, numbers = text.partition(":")
    return {kind: _numbers(numbers, option)}


def _equation(text: str, option: str) -> dict[str, Any]:
    left, sign, right = text.partition("=")
    terms = []
    for term in left.split(","):
        place, _, coefficient = term.strip().partition(":")
        node, dot, component = place.rpartition(".")
        if not dot:
            raise InvalidArgumentError(f"{option} is {text}; expected NODE.x:NUMBER,NODE.y:NUMBER=NUMBER")
        terms.append([node, component, _entry(coefficient, option, text)])
    return {"terms": terms} | ({"value": _entry(right, option, text)} if sign else {})


_PULL = "NAME=fx,fy[,fz]"
#: By their names in `fem.mesh_problem`.
MESH_OPTIONS = {
    "contact": Given(_BODY, "NAME", _as_given),
    "pairs": Given(_BODY, "NAME:NAME[:GAP]", _pair),
    "young": Given(_BODY, "[NAME=]E", _number),
    "poisson": Given(_BODY, "[NAME=]NU", _number),
    "orthotropic": Given(_BODY, "[NAME=]E1,E2,E3,NU12,NU13,NU23,G12,G13,G23", _numbers),
    "orientation": Given(_BODY, "[NAME=]x1,y1,z1,x2,y2,z2", _numbers),
    "incompatible": Given(_BODY, "NAME", _as_given),
    "plane": Given(_BODY, "[NAME=]strain|stress|axisymmetric", _plane),
    "thickness": Given(_BODY, "[NAME=]LENGTH", _number),
    "expansion": Given(_BODY, "[NAME=]NUMBER", _number),
    "temperature": Given(_LOAD, "[NAME=]NUMBER", _number),
    "temperature_slope": Given(_LOAD, "[NAME=]NUMBER", _number),
    "density": Given(_BODY, "[NAME=]DENSITY", _number),
    "friction": Given(_BODY, "[NAME=]F", _number_or_numbers),
    "friction_slope": Given(_BODY, "[NAME=]F", _number_or_numbers),
    "friction2": Given(_BODY, "[NAME=]F", _number_or_numbers),
    "friction2_slope": Given(_BODY, "[NAME=]F", _number),
    "axis": Given(_BODY, "x,y,z", _numbers, False),
    "gap": Given(_BODY, "[NAME=]LENGTH", _number),
    "obstacle": Given(_BODY, "KIND=NUMBERS", _obstacle, False),
    "groups": Given(_BODY, "NAME", _as_given, False),
    "clamp": Given(_SUPPORT, "NAME", _as_given),
    "symmetry": Given(_SUPPORT, "NAME", _as_given),
    "displacement": Given(_SUPPORT, "NAME=ux,uy[,uz]", _numbers),
    "displacement_slope": Given(_SUPPORT, "NAME=ux,uy[,uz]", _numbers),
    "transform": Given(_SUPPORT, "NAME=KIND:NUMBERS", _axes),
    "tie": Given(_SUPPORT, "NAME:NAME[:GAP]", _pair),
    "reference": Given(_SUPPORT, "NAME=x,y[,z]", _numbers),
    "rigid": Given(_SUPPORT, "NAME=PART[,PART]", _parts),
    "coupling": Given(_SUPPORT, "NAME=PART[,PART]", _parts),
    "equations": Given(_SUPPORT, "NODE.x:C,NODE.y:C[=VALUE]", _equation),
    "spring": Given(_SUPPORT, "NAME=kn,kt", _numbers),
    "node_spring": Given(_SUPPORT, "NAME=kx,ky[,kz]", _number_or_numbers),
    "max_rigid_displacement": Given(_SUPPORT, "LENGTH|auto", _auto_or_number, False),
    "load": Given(_LOAD, _PULL, _numbers),
    "load_slope": Given(_LOAD, _PULL, _numbers),
    "pressure": Given(_LOAD, "NAME=P", _number),
    "pressure_slope": Given(_LOAD, "NAME=P", _number),
    "body_force": Given(_LOAD, "[NAME=]fx,fy[,fz]", _numbers),
    "body_force_slope": Given(_LOAD, "[NAME=]fx,fy[,fz]", _numbers),
    "centrifugal": Given(_LOAD, "NAME=c,x,y,z,ax,ay,az", _numbers),
    "centrifugal_slope": Given(_LOAD, "NAME=c,x,y,z,ax,ay,az", _numbers),
    "force": Given(_LOAD, _PULL, _numbers),
    "force_slope": Given(_LOAD, _PULL, _numbers),
    "moment": Given(_LOAD, "NAME=M[,My,Mz]", _number_or_numbers),
    "moment_slope": Given(_LOAD, "NAME=M[,My,Mz]", _number_or_numbers),
}


def _flags(name: str) -> tuple[str, ...]:
    """Spellings of an option of `fem.mesh_problem` on the command line, the usual one first."""
    return (*(["--pair"] if name == "pairs" else []), "--" + name.replace("_", "-"))


def _option(name: str, given: Given) -> Parameter:
    how = typer.Option(*_flags(name), metavar=given.metavar, rich_help_panel=given.panel, show_default=False)
    annotation = Annotated[list[str] | None, how] if given.repeated else Annotated[str | None, how]
    return Parameter(name, Parameter.KEYWORD_ONLY, default=None, annotation=annotation)


_ALPHA = Annotated[str | None, typer.Option(metavar="NUMBER", rich_help_panel=LIMITS, show_default=False)]
_OPTIONS = (
    *(_option(name, given) for name, given in MESH_OPTIONS.items()),
    Parameter("alpha", Parameter.KEYWORD_ONLY, default=None, annotation=_ALPHA),
    *options_of(Search, "method", "unique"),
)


@with_options(*_OPTIONS, after=1)
def solve(
    mesh: Argument,
    *,
    output: Annotated[str | None, typer.Option("--output", "-o", metavar="FILE", rich_help_panel=OUTPUT)] = None,
    dry_run: OutputFlag = False,
    plot: OutputFile | None = None,
    quiet: Quiet = False,
    **options: Any,
) -> None:
    """Build a contact problem from MESH and find all its solutions.

    A .toml file holds the same options under the same names (`load_slope`, not `--load-slope`), and `mesh`. All other
    commands accept such files as PROBLEM, and also the files that --output writes. So they do decks of CalculiX and
    Abaqus with materials, contact and steps (.inp), which need no options here either. Without --alpha, a problem that
    depends on alpha is written but not solved. With --dry-run, what was understood is printed.

    Exit status: as enumsol roots.

    Parameters
    ----------
    mesh : A mesh with named parts (.msh, .vtu, ...), or a .toml file.
    contact : Part of the boundary in contact; may be repeated.
    pairs : Parts of two bodies that may touch, first the one whose nodes are the contact nodes; may be repeated.
    young : Young's modulus [force / length^2], by parts of the body.
    poisson : Poisson's ratio, by parts of the body.
    orthotropic : Nine constants of an orthotropic material, by parts of the body.
    orientation : Direction of its axis 1 and one in the plane of axes 1 and 2; default: x and y.
    incompatible : Part of the body whose quadrilaterals and hexahedra of first order have incompatible modes, as C3D8I.
    plane : In 2D, plane strain, plane stress, or axisymmetric about x = 0; default: strain, or what the elements of a
        deck are.
    expansion : Coefficient of thermal expansion, by parts of the body.
    temperature : Change of temperature, by parts of the body, of nodes or of the boundary.
    temperature_slope : The same, times alpha.
    thickness : In 2D, thickness; by default all forces are per unit thickness.
    density : Mass per volume, by parts of the body, for --stability; a uniform one need not be given.
    friction : Coefficient of friction, by contact parts (in 3D also F1,F2); without it and --friction-slope it is
        alpha.
    friction_slope : The same, times alpha.
    friction2 : In 3D, coefficient of friction along the second axis.
    friction2_slope : The same, times alpha.
    axis : In 3D, direction of the first axis of friction.
    gap : Initial gap, by contact parts; negative is a press fit.
    obstacle : plane=x,y,nx,ny (normal towards the body), circle=x,y,r, hole=x,y,r; in 3D plane=x,y,z,nx,ny,nz,
        sphere=x,y,z,r, hole=x,y,z,r. Default: the contact part itself, moved by the gap.
    groups : Name of the cell data that groups the facets, for a file without names of parts.
    clamp : Part that is held; may be repeated.
    symmetry : Part on a plane of symmetry, or on rollers.
    displacement : Prescribed displacements; `free` for a component that is not prescribed.
    displacement_slope : The same, times alpha.
    transform : Axes of nodes: rectangular:ax,ay (in 3D ax,ay,az,bx,by,bz), cylindrical:x,y (in 3D two points).
    tie : Parts that are joined, first the one whose nodes follow the facets of the other; may be repeated.
    reference : A reference point, for rigid, coupling, force, moment, clamp, displacement and node-spring.
    rigid : Parts that move as a rigid body with a reference point.
    coupling : Parts over which force and moment of a reference point are distributed.
    equations : A linear equation between displacements, such as tip.x:1,7.x:-1=0.01; may be repeated.
    spring : Springs per area, along the normal and along the tangents.
    node_spring : Springs at each node; as NODE:NODE=... between two (also one stiffness, along the line between them).
    max_rigid_displacement : Let bodies that only contact holds move as a whole, by at most this length; auto: 10 times
        the mesh's size.
    load : Force per area (in 2D per length and unit thickness).
    load_slope : The same, times alpha.
    pressure : Force per area into the body.
    pressure_slope : The same, times alpha.
    body_force : Force per volume, such as the weight, by parts of the body.
    body_force_slope : The same, times alpha.
    centrifugal : Density times speed squared of a part of the body that turns, a point on the axis, and its direction.
    centrifugal_slope : The same, times alpha.
    force : Force on each node of a part or set of nodes, in 2D of the whole thickness.
    force_slope : The same, times alpha.
    moment : Moment on a reference point.
    moment_slope : The same, times alpha.
    alpha : Parameter value: a number, or a fraction such as 8/3; required if friction or load depend on it.
    output : Write the problem for the other commands: .npz, .h5, or a new directory.
    dry_run : Print what was understood: bodies, parts, loads, contact nodes, rigid modes. Nothing is solved.
    plot : Draw the bodies with their parts, loads and contact nodes: .png, .pdf, .svg.
    """
    texts = {name: options.pop(name) for name in MESH_OPTIONS}
    given = {name: MESH_OPTIONS[name].value(text, _flags(name)[0]) for name, text in texts.items() if text is not None}
    alpha = options.pop("alpha")
    search = Search(**options)
    search.check()
    value = None if alpha is None else parse_alpha(alpha)
    units = units_of(mesh, search.units)
    with Display("reading the mesh"):
        scene = _scene(mesh, given)
    if dry_run:
        deliver(
            (plot, lambda path: write_figure(path, scene.plot(units=units))),
            json_file=search.json_file,
            text=lambda: str(scene),
            content=lambda: {"scene": str(scene).splitlines(), "notes": scene.notes},
        )
    elif plot is not None:
        write_figure(plot, scene.plot(units=units))
    with Display("assembling"):
        problem = _problem(mesh, scene)
    if output is not None:
        _write(problem, output)
    if dry_run:
        return
    for text in scene.notes:
        note(text)
    if value is None and problem.depends_on_alpha:
        if output is not None:
            return
        raise InvalidArgumentError("--alpha is missing, on which friction or load depend; expected it, or --output")
    source = (
        output if output is not None else mesh if mesh.endswith(TOML) or (common.is_deck(mesh) and not given) else None
    )
    search.answer(mesh, problem, value or 0.0, source, scene)


def _scene(mesh: str, options: dict[str, Any]) -> Scene:
    """Scene that the mesh and the options, or a TOML file or a deck, describe."""
    from enumsol import fem  # numpy: not for --help
    from enumsol.fem.conditions import refuse_old_friction
    from enumsol.fem.mesh_problems import check_keys
    from enumsol.io import SUFFIXES
    from enumsol.support.arguments import file_path
    from enumsol.support.files import unreadable

    if mesh.endswith(TOML):
        if options:
            flag = _flags(next(iter(options)))[0]
            raise InvalidArgumentError(f"{flag} is given beside {mesh}, which has all options; expected it there")
        refuse_misspelt(mesh)
    whole = scene_of(mesh) if mesh.endswith(TOML) or (common.is_deck(mesh) and not options) else None
    if whole is not None:
        return whole
    place = file_path(mesh, "MESH", "the name of a mesh file")
    if place.suffix in SUFFIXES or mesh.startswith(GALLERY):
        raise InvalidArgumentError(f"{mesh} is a problem; expected a mesh (enumsol roots {mesh} solves a problem)")
    refuse_misspelt(mesh, meshes=True)
    if (found := unreadable(place)) is not None:
        raise InvalidArgumentError(f"{mesh}: {found}; expected a mesh with named parts, or a {TOML} file")
    check_keys(options, lambda name: _flags(name)[0])
    written = lambda name, part, number: f"{_flags(name)[0]} {part and f'{part}='}{number}"  # noqa: E731
    cards = common.ignored()
    source = fem.read_mesh(mesh, ignore=cards) if cards else mesh
    return fem.mesh_scene(refuse_old_friction(source, options, written), **options)


def _problem(mesh: str, scene: Scene) -> AnyProblem:
    try:
        return scene.problem()
    except (InvalidArgumentError, InvalidProblemError) as error:
        if mesh.endswith(TOML):
            raise InvalidProblemError(f"{mesh}: {error}") from error
        message = str(error)
        for name in (name for name in MESH_OPTIONS if "_" in name):
            message = message.replace(name, _flags(name)[0])
        raise type(error)(message) from error


def _write(problem: AnyProblem, place: str) -> None:
    from enumsol.io import write_problem  # as above

    write_problem(problem, place)
    note(f"wrote a problem with {problem.n} degrees of freedom and {problem.p} contact nodes to {place}")
