"""The problem as its user gave it: material, supports, loads, springs and gaps, with units."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from enumsol.report.parts import fact_list, table_text

if TYPE_CHECKING:
    from enumsol.fem import Scene

#: Powers of force and of length in the unit of every option of `enumsol.fem.mesh_problem` that has one.
_POWERS = {
    **dict.fromkeys(("young", "load", "load_slope", "pressure", "pressure_slope"), (1, -2)),
    **dict.fromkeys(("spring", "body_force"), (1, -3)),
    **dict.fromkeys(("thickness", "displacement", "gap", "obstacle", "max_rigid_displacement"), (0, 1)),
}
#: Options that mean nothing in 3D.
_PLANE = ("plane", "thickness")
_RAISED = {1: "", 2: "\N{SUPERSCRIPT TWO}", 3: "\N{SUPERSCRIPT THREE}"}


def unit_text(units: tuple[str, str] | None, force: int, length: int) -> str:
    """The unit of a quantity, as in "N/mm²": powers of force, 0 or 1, and of length."""
    if units is None:
        return ""
    if length > 0:
        return units[1] + _RAISED[length]
    return units[0] if length == 0 else f"{units[0]}/{units[1]}{_RAISED[-length]}"


def with_unit(text: str, units: tuple[str, str] | None, force: int, length: int) -> str:
    """A number as text, with its unit if units are known."""
    return f"{text} {unit_text(units, force, length)}".rstrip()


def given_section(scene: Scene | None, units: tuple[str, str] | None) -> str:
    """A section of the page with the options of a scene and what they make; empty without one."""
    if scene is None:
        return ""
    rows = [
        ("", (name, _said(value), unit_text(units, *_POWERS[name]) if name in _POWERS else ""))
        for name, value in scene.options.items()
        if value is not None and not (np.ndim(value) == 1 and len(value) == 0)
        if scene.dimension == 2 or name not in _PLANE
    ]
    about = fact_list((title, "; ".join(lines)) for title, lines in scene.sections.items() if lines)
    words = "" if units is not None else "<p>Numbers are in the user's own consistent units.</p>"
    table = table_text("The options of the problem", ("option", "as given", "unit"), rows)
    return (
        f'<section id="given"><h2>The problem as it was given</h2>{words}{table}'
        f'<h3>What this makes of the mesh</h3><dl class="facts">{about}</dl></section>'
    )


def _said(value: Any) -> str:
    """What an option was given, in words."""
    if isinstance(value, Mapping):
        return "; ".join(f"{part}: {_said(own)}" for part, own in value.items())
    if isinstance(value, (list, tuple, np.ndarray)):
        return ", ".join(_said(own) for own in value)
    return str(value) if isinstance(value, str) or value is None else f"{float(value):.10g}"
