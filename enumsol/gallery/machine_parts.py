"""Parts of machines in N, mm and MPa, of quadratic quadrilaterals: every function returns a `ContactProblem`."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from enumsol import fem
from enumsol.errors import InvalidArgumentError
from enumsol.fem.meshes import MOST_CELLS
from enumsol.model.shapes import body_mesh
from enumsol.support.arguments import finite_number, positive_integer, positive_number, shown
from enumsol.support.array_arguments import short_vector

if TYPE_CHECKING:
    from collections.abc import Callable

    from enumsol.gallery.problems import Pair
    from enumsol.model.problem import ContactProblem
    from enumsol.support.array_types import Floats, Integers


#: Young's modulus [MPa], and Poisson's ratio.
_STEEL: dict[str, Any] = {"young": 210e3, "poisson": 0.3}


def dovetail(
    nx: int = 4,
    ny: int = 3,
    pull: Pair = (0.0, 100.0),
    press: float = 0.0,
    *,
    flank_angle: float = 45.0,
    friction: float | None = None,
    friction_slope: float | None = None,
) -> ContactProblem:
    """Dovetail root of a blade, pulled into the flanks of its slot by the centrifugal force: one solution.

    The root is 30 mm wide below its flanks and 14 mm above, of steel, in plane strain. Both flanks are contact
    boundaries: first the left, then the right one, each in the order of the mesh; p = 2 (2 ny + 1). ``pull`` acts on
    the shank, by default 1.4 kN per mm of the length of the slot. A weak spring below the foot (1 N / mm^3) keeps a
    blade in place that does not turn.

    If all nodes slip outwards, the flanks carry the pull P by normal forces N and friction F N, and by balance N is
    P / (sin(a) + F cos(a)) on both together, with the angle a of the flanks. A flank steeper than friction holds,
    tan(a) < F, would jam; those of blades are not: there is one solution for every F up to 1. From F = 1.000138, just
    above tan(a), to 1.171 there are three: one flank may stick, too. From there up to 3 there is one again, and both
    stick.

    Parameters
    ----------
    nx, ny : int
        Cells across the root and along each flank, at least 1.
    pull : (float, float)
        Force per area of the shank in x and y; positive y is out of the slot [N / mm^2].
    press : float
        Interference with both flanks, along the normals [mm].
    flank_angle : float
        Angle between a flank and the direction of the blade, between 5 and 85 [degrees].
    friction, friction_slope : float or None
        As in `enumsol.fem.mesh_problem`; without both F(alpha) = alpha.

    Raises
    ------
    InvalidArgumentError
        An argument is not of the stated form.

    Examples
    --------
    >>> import enumsol
    >>> (root,) = enumsol.enumerate_roots(enumsol.gallery.dovetail(friction=0.2), alpha=0)
    >>> round(float(root.lambda_n.sum())), set(map(str, root.statuses)) == {"slip+", "slip-"}  # 1400 N / 1.2 sin 45
    (1650, True)
    """
    rows = positive_integer(ny, "ny", most=MOST_CELLS)
    angle = positive_number(flank_angle, "flank_angle")
    if not 5.0 <= angle <= 85.0:
        raise InvalidArgumentError(f"flank_angle is {shown(flank_angle)}; expected degrees between 5 and 85")
    # widths below and above the flanks, height of the land below them and of the shank above
    foot, neck, land, shank = 30.0, 14.0, 6.0, 6.0
    flank = (foot - neck) / 2.0 / math.tan(math.radians(angle))
    levels = np.concatenate([[0.0], np.linspace(land, land + flank, rows + 1), [land + flank + shank]])

    def place(x: Floats, y: Floats) -> tuple[Floats, Floats]:
        height = np.interp(y, np.linspace(0.0, 1.0, rows + 3), levels)
        width = np.interp(height, [land, land + flank], [foot, neck])
        return (x - 0.5) * width, height

    grid = _Grid.of(nx, rows + 2, place)
    bottom, top, left, right = grid.sides
    return _problem(
        grid.mesh({"left": left[1:-1], "right": right[1:-1], "foot": bottom, "shank": top}),
        **_STEEL,
        contact=["left", "right"],
        load={"shank": short_vector(pull, "pull", 2)},
        spring={"foot": (1.0, 1.0)},
        gap=-finite_number(press, "press"),
        friction=friction,
        friction_slope=friction_slope,
    )


def brake_shoe(
    nx: int = 4,
    ny: int = 3,
    pull: float = 50.0,
    turn: float = 0.1,
    *,
    friction: float | None = None,
    friction_slope: float | None = None,
) -> ContactProblem:
    """Brake shoe on a drum, pulled off by its return spring: it is released, or the drum has locked it.

    The shoe stands on a drum of radius 300 mm: 40 mm wide, 120 mm high and 50 mm deep, in plane stress. It hangs from
    a pin at its upper left corner, and has a lining of 10 mm (E = 500 MPa) on its body of steel. The drum has turned to
    the left by ``turn`` on its rim, the direction in which friction draws the shoe onto it, and a return spring (50 N /
    mm) at the upper right pulls the shoe off with the force ``pull``. The contact nodes are those of the lining, p =
    2 nx + 1.

    About the pin, normal forces have short arms a_n and lift the shoe, while friction has a long arm a_t and draws it
    onto the drum. Once F is greater than a_n / a_t (0.325 for a rigid shoe with an elastic lining), the brake is
    self-locking: with the friction of linings, 0.35 to 0.45, it may not release although it is pulled off. With the
    default arguments there is one solution, the released shoe, up to F = 0.347, and from there on there are three:
    released, locked, and one between them of index -1.

    Parameters
    ----------
    nx, ny : int
        Cells of the lining along the drum, and of the body of the shoe along its height, at least 1.
    pull : float
        Force of the return spring on the shoe at rest; positive lifts it [N].
    turn : float
        By how much the drum has turned, on its rim [mm].
    friction, friction_slope : float or None
        As in `enumsol.fem.mesh_problem`; without both F(alpha) = alpha.

    Raises
    ------
    InvalidArgumentError
        An argument is not of the stated form.

    Examples
    --------
    >>> import enumsol
    >>> shoe = enumsol.gallery.brake_shoe()
    >>> [len(enumsol.enumerate_roots(shoe, F)) for F in (0.2, 0.3, 0.4)]
    [1, 1, 3]
    """
    columns, rows = (positive_integer(count, name, most=MOST_CELLS) for name, count in (("nx", nx), ("ny", ny)))
    # radius of the drum; width, height and depth of the shoe, its overhang and its lining
    drum, width, height, depth, overhang, lining = 300.0, 40.0, 120.0, 50.0, 10.0, 10.0
    heights = np.concatenate([[0.0], np.linspace(lining / height, 1.0, rows + 1)])

    def place(x: Floats, y: Floats) -> tuple[Floats, Floats]:
        across, share = (x - 0.5) * width, np.interp(y, np.linspace(0.0, 1.0, rows + 2), heights)
        rim = np.sqrt(drum**2 - across**2)
        return across - overhang * share, rim + share * (drum + height - rim)

    grid = _Grid.of(columns, rows + 1, place)
    bottom, top, _, _ = grid.sides
    parts = {"lining": np.arange(columns), "body": np.arange(columns, len(grid.cells))}
    area = width / columns * depth
    shoe = _problem(
        grid.mesh({"rubbing": bottom, "eye": top[-1:]}, {"pin": grid.number[-1, :1]}, parts),
        young={"lining": 500.0, "body": 210e3},
        poisson=0.3,
        plane="stress",
        thickness=depth,
        contact="rubbing",
        clamp="pin",
        load={"eye": (0.0, finite_number(pull, "pull") / area)},
        spring={"eye": (50.0 / area, 50.0 / area)},
        friction=friction,
        friction_slope=friction_slope,
    )
    # the tangent points to the right, and slip is counted from where the drum has gone
    return shoe.replace(slip_offset=np.full(shoe.p, -finite_number(turn, "turn")))


def clip(
    nx: int = 8,
    ny: int = 1,
    pull: float = 10.0,
    press: float = 0.1,
    *,
    friction: float | None = None,
    friction_slope: float | None = None,
) -> ContactProblem:
    """Spring clip on a round bar, pulled off: it grips the bar, or it has sprung off.

    A strip of spring steel, 2 mm thick and 10 mm wide, is bent to an arc that embraces 160 degrees of a bar of 20 mm
    in diameter, less than half of it. It is in plane stress. It is narrower than the bar by ``press``, and a line (10 N
    / mm) pulls at its crown with the force ``pull``. All nodes of the inner side are contact nodes, p = 2 nx + 1.

    The lips press on the bar 10 degrees above its middle: there, normal forces push the clip off, and friction holds it
    if F > tan(10 degrees) = 0.176. Up to that coefficient the only solution is the clip that has sprung off. With the
    default arguments it may grip as well from F = 0.205 on: there are then three solutions, with one between these two
    of index -1.

    Parameters
    ----------
    nx, ny : int
        Cells along the arc and across the strip, at least 2 and 1; for even nx the mesh is symmetric.
    pull : float
        Force on the crown, off the bar [N].
    press : float
        By how much the radius of the clip is smaller than that of the bar [mm].
    friction, friction_slope : float or None
        As in `enumsol.fem.mesh_problem`; without both F(alpha) = alpha.

    Raises
    ------
    InvalidArgumentError
        An argument is not of the stated form.

    Examples
    --------
    >>> import enumsol
    >>> clip = enumsol.gallery.clip()
    >>> [len(enumsol.enumerate_roots(clip, F)) for F in (0.1, 0.15, 0.25, 0.3)]
    [1, 1, 3, 3]
    """
    columns = positive_integer(nx, "nx", least=2, most=MOST_CELLS)
    # radius of the bar, thickness and width of the strip, and half of the angle that it embraces
    bar, strip, width, half = 10.0, 2.0, 10.0, math.radians(80.0)

    def place(x: Floats, y: Floats) -> tuple[Floats, Floats]:
        angle, radius = math.pi / 2.0 + half * (1.0 - 2.0 * x), bar + strip * y
        return radius * np.cos(angle), radius * np.sin(angle)

    grid = _Grid.of(columns, ny, place)
    middle = columns // 2
    bottom, top, _, _ = grid.sides
    crown = top[middle - 1 + columns % 2 : middle + 1]
    area = width * float(np.sum(np.linalg.norm(grid.points[crown[:, 0]] - grid.points[crown[:, 1]], axis=1)))
    unit = _problem(
        grid.mesh({"inside": bottom, "crown": crown}),
        **_STEEL,
        plane="stress",
        thickness=width,
        contact="inside",
        load={"crown": (0.0, 1.0)},
        spring={"crown": (10.0 / area, 10.0 / area)},
        gap=-finite_number(press, "press"),
        friction=friction,
        friction_slope=friction_slope,
    )
    force = finite_number(pull, "pull")
    return unit.replace(f=force / np.sum(unit.f) * unit.f)


def pressed_rings(
    nx: int = 8,
    ny: int = 1,
    torque: float = 60e3,
    press: float = 0.01,
    *,
    friction: float | None = None,
    friction_slope: float | None = None,
) -> ContactProblem:
    """Two rings of steel pressed onto each other, the outer one loaded by a torque: one solution.

    The inner ring reaches from the radius 10 mm, where a rigid spindle holds it, to 20 mm, the outer one from there to
    30 mm. They are 10 mm wide, in plane stress. Before they were joined, the outer ring was smaller by ``press``. Two
    deformable bodies touch: the nodes on the inside of the outer ring are the contact nodes, p = 2 nx. A torque acts on
    the outer ring by forces on four lugs, and very weak springs (0.01 N / mm^3) hold it when it is free to turn.

    The pressure is that of Lame's rings, and friction transmits the torque F N r with the sum N of the normal forces
    (39 kN) and the radius r of the joint: 118 N m for F = 0.15. Below that, some or all nodes stick; above it the outer
    ring turns as far as the springs allow. There is one solution for every F up to 0.5.

    Parameters
    ----------
    nx, ny : int
        Cells along the circumference, a multiple of 4, and across each ring, at least 1.
    torque : float
        Torque on the outer ring, counterclockwise [N mm].
    press : float
        Interference of the radii [mm].
    friction, friction_slope : float or None
        As in `enumsol.fem.mesh_problem`; without both F(alpha) = alpha.

    Raises
    ------
    InvalidArgumentError
        An argument is not of the stated form.

    Examples
    --------
    >>> import enumsol
    >>> (root,) = enumsol.enumerate_roots(enumsol.gallery.pressed_rings(), alpha=0.15)
    >>> round(abs(float(root.lambda_t.sum())) * 20, -2)  # but for the springs, the torque
    60000.0
    """
    columns = positive_integer(nx, "nx", least=4, most=MOST_CELLS)
    if columns % 4:
        raise InvalidArgumentError(f"nx is {shown(nx)}; expected a multiple of 4, since there are four lugs")
    moment = finite_number(torque, "torque")
    inner, outer = (_ring(columns, ny, *radii) for radii in ((10.0, 20.0), (20.0, 30.0)))
    both = inner.beside(outer)
    count = len(inner.points)
    (bore, seat, _, _), (inside, rim, _, _) = inner.sides, (count + side for side in outer.sides)
    lugs = {f"lug{k}": rim[k * columns // 4 : k * columns // 4 + 1] for k in range(4)}
    unit = _problem(
        both.mesh({"bore": bore, "seat": seat, "inside": inside, "rim": rim, **lugs}),
        **_STEEL,
        plane="stress",
        thickness=10.0,
        pairs=[("inside", "seat", 0.0)],
        clamp="bore",
        load={name: both.points[lug[0, 2]] @ [[0.0, 1.0], [-1.0, 0.0]] for name, lug in lugs.items()},
        spring={"rim": (0.01, 0.01)},
        gap=-finite_number(press, "press"),
        friction=friction,
        friction_slope=friction_slope,
    )
    mesh = body_mesh(unit)
    (x, y), (fx, fy) = mesh.points.T, (mesh.motion @ unit.f).reshape(-1, 2).T
    return unit.replace(f=moment / np.sum(x * fy - y * fx) * unit.f)


def lap_joint(
    nx: int = 4,
    ny: int = 1,
    stretch: float = 0.01,
    clamping: float = 20e3,
    *,
    friction: float | None = None,
    friction_slope: float | None = None,
) -> ContactProblem:
    """Lap joint of two plates that bolts press together and that are pulled apart: one solution.

    Plates of steel, 60 mm long, 4 mm thick and 20 mm wide, overlap by 30 mm; plane stress. The left end of the lower
    plate is clamped, and a testing machine moves the right end of the upper one to the right, by ``stretch``.
    Bolts press on both plates evenly along the overlap, with the total force ``clamping``. The nodes of the upper plate
    on the overlap are the contact nodes, p = 2 nx + 1, and the meshes of both plates match.

    Friction transmits at most F times the force that presses the plates together. Where all nodes stick, the joint is
    as stiff as if the plates were one body.

    Parameters
    ----------
    nx, ny : int
        Cells along the overlap and across each plate, at least 1.
    stretch : float
        Displacement of the end of the upper plate, to the right [mm].
    clamping : float
        Force of all bolts, > 0 [N].
    friction, friction_slope : float or None
        As in `enumsol.fem.mesh_problem`; without both F(alpha) = alpha.

    Raises
    ------
    InvalidArgumentError
        An argument is not of the stated form.

    Examples
    --------
    >>> import enumsol
    >>> (root,) = enumsol.enumerate_roots(enumsol.gallery.lap_joint(), alpha=0.3)
    >>> round(float(root.lambda_t.sum()))  # what is transmitted; the ends of the overlap slip
    1504
    >>> [str(root.statuses[k]) for k in (0, 4, 8)]
    ['slip+', 'stick', 'slip+']
    """
    columns = positive_integer(nx, "nx", most=MOST_CELLS)
    bolt = positive_number(clamping, "clamping")
    # length of a plate and of the overlap, thickness and width of the plates
    plate, lap, thick, broad = 60.0, 30.0, 4.0, 20.0

    def from_corner(left: float, level: float) -> _Grid:
        return _Grid.of(2 * columns, ny, lambda x, y: (left + plate * x, level + thick * y))

    # as many cells on the free part of a plate, which is as long as the overlap
    lower, upper = from_corner(0.0, 0.0), from_corner(plate - lap, thick)
    both = lower.beside(upper)
    bottom, top, end, _ = lower.sides
    lower_side, upper_side, _, grip = (len(lower.points) + side for side in upper.sides)
    facets = {"end": end, "grip": grip, "lap": lower_side[:columns], "seat": top[columns:]}
    facets |= {"nut": bottom[columns:], "head": upper_side[:columns]}
    pressure = bolt / (lap * broad)
    return _problem(
        both.mesh(facets),
        **_STEEL,
        plane="stress",
        thickness=broad,
        pairs=[("lap", "seat")],
        clamp="end",
        displacement={"grip": (finite_number(stretch, "stretch"), 0.0)},
        pressure={"nut": pressure, "head": pressure},
        friction=friction,
        friction_slope=friction_slope,
    )


@dataclass(frozen=True)
class _Grid:
    """Quadrilaterals with 9 nodes, nx along the bottom by ny, at the images of the cells of the unit square.

    Attributes
    ----------
    points : (N, 2) array
    cells : (nx ny, 9) int array
    number : (2 ny + 1, 2 nx + 1) int array
        The nodes in their rows, from the bottom up.
    """

    points: Floats
    cells: Integers
    number: Integers

    @classmethod
    def of(
        cls, nx: int, ny: int, place: Callable[[Floats, Floats], tuple[Floats, Floats]], *, closed: bool = False
    ) -> _Grid:
        """The cells at the places of (0, 1) x (0, 1); if ``closed``, the right side is the left one."""
        nx, ny = (positive_integer(count, name, most=MOST_CELLS) for name, count in (("nx", nx), ("ny", ny)))
        x, y = np.meshgrid(np.linspace(0.0, 1.0, 2 * nx + 1), np.linspace(0.0, 1.0, 2 * ny + 1))
        points = np.stack(place(x, y), axis=-1)
        if closed:
            points = points[:, :-1]
        number = np.arange(points.shape[0] * points.shape[1]).reshape(points.shape[:2])
        if closed:
            number = np.hstack([number, number[:, :1]])
        # corners, the nodes between them, and the one inside: by row and column in the cell
        where = ((0, 0), (0, 2), (2, 2), (2, 0), (0, 1), (1, 2), (2, 1), (1, 0), (1, 1))
        cells = np.stack([number[i : 2 * ny + i : 2, j : 2 * nx + j : 2] for i, j in where], axis=-1)
        return cls(points.reshape(-1, 2), cells.reshape(-1, 9), number)

    @property
    def sides(self) -> tuple[Integers, Integers, Integers, Integers]:
        """Edges with their middle nodes, (k, 3), along the bottom, the top, the left and the right."""
        lines = self.number[0], self.number[-1], self.number[:, 0], self.number[:, -1]
        bottom, top, left, right = (np.stack([line[:-1:2], line[2::2], line[1::2]], axis=1) for line in lines)
        return bottom, top, left, right

    def beside(self, other: _Grid) -> _Grid:
        """Both in one mesh, without a common node: the numbers of the other's come after its own."""
        cells = np.concatenate([self.cells, len(self.points) + other.cells])
        return _Grid(np.concatenate([self.points, other.points]), cells, self.number)

    def mesh(
        self,
        facets: dict[str, Integers],
        nodes: dict[str, Integers] | None = None,
        bodies: dict[str, Integers] | None = None,
    ) -> fem.PartedMesh:
        """With named parts of its boundary, sets of nodes and parts of the body."""
        return fem.PartedMesh(self.points, self.cells, facets, nodes or {}, bodies or {})


def _problem(mesh: fem.PartedMesh, **options: Any) -> ContactProblem:
    problem: Any = fem.mesh_problem(mesh, **options)  # in 2D
    return problem  # type: ignore[no-any-return]


def _ring(nx: int, ny: int, inside: float, outside: float) -> _Grid:
    def place(x: Floats, y: Floats) -> tuple[Floats, Floats]:
        radius, angle = inside + (outside - inside) * y, -2.0 * math.pi * x
        return radius * np.cos(angle), radius * np.sin(angle)

    return _Grid.of(nx, ny, place, closed=True)
