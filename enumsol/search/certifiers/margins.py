"""The exclusion inequalities for the search at one alpha: compiled if installed, else those of the trusted core."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from enumsol.trusted.at_alpha import exclusion_margin
from enumsol.trusted.quadratic_forms import form_margin

if TYPE_CHECKING:
    from collections.abc import Callable

    import numpy as np
    from numpy.typing import NDArray

    from enumsol.condensation.enclosure import EnclosedSystem
    from enumsol.selections.solution import Codes
    from enumsol.trusted.quadratic_forms import EnclosedForm

    #: A lower bound over a partial assignment, proven by the multipliers of its rows.
    Margin = Callable[[Codes, NDArray[np.intp], NDArray[np.float64]], float]


def energy_margin(system: EnclosedSystem) -> Margin:
    """Lower bounds on the energy, less twice the error bound (theory, section 6.2)."""
    try:
        from enumsol.search.certifiers._margin import Margins
    except ImportError:
        return partial(exclusion_margin, system, errors=2.0)
    return Margins((system,), system.F, system.F).margin


def margin_of_form(form: EnclosedForm, errors: float) -> Margin:
    """Lower bounds on a form, less the error bound so many times (theory, section 6.12)."""
    try:
        from enumsol.search.certifiers._margin import FormMargins
    except ImportError:
        return partial(form_margin, form, errors=errors)
    return FormMargins(form, errors).margin
