"""The exclusion inequalities for the search: compiled if installed, else those of the trusted core."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from enumsol.trusted.exclusion import exclusion_margin
from enumsol.trusted.over_interval import EnclosedPiece

if TYPE_CHECKING:
    from collections.abc import Callable

    import numpy as np
    from numpy.typing import NDArray

    from enumsol.condensation.enclosure import EnclosedSystem
    from enumsol.selections.solution import Codes
    from enumsol.trusted.quadratic_forms import EnclosedForm

    #: A lower bound over a partial assignment, proven by the multipliers of its rows.
    Margin = Callable[[Codes, NDArray[np.intp], NDArray[np.float64]], float]

#: How often the error bound of an exclusion with a form is subtracted where a proof is written.
FORM_ERRORS = 4.0


def energy_margin(within: EnclosedSystem | EnclosedPiece) -> Margin:
    """Lower bounds on the energy, less twice the error bound (theory, sections 6.2 and 7.9)."""
    try:
        from enumsol.search.certifiers._margin import Margins
    except ImportError:
        return partial(exclusion_margin, within, errors=2.0)
    if isinstance(within, EnclosedPiece):
        return Margins(within.ends, within.low, within.high).margin
    return Margins((within,), within.F, within.F).margin


def margin_of_form(form: EnclosedForm, errors: float) -> Margin:
    """Lower bounds on a form, less the error bound so many times (theory, section 6.12)."""
    try:
        from enumsol.search.certifiers._margin import FormMargins
    except ImportError:
        return partial(exclusion_margin, form, errors=errors)
    return FormMargins(form, errors).margin
