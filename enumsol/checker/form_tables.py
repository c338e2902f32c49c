"""Forms declared in a proof, and the leaves that they exclude (docs/proof_format.md, under Forms)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from enumsol.trusted.exclusion import Leaves, exclusion_margins
from enumsol.trusted.quadratic_forms import EnclosedForm

if TYPE_CHECKING:
    from enumsol.condensation.enclosure import EnclosedSystem
    from enumsol.proof.records import DeclaredForm, ExcludedByForm
    from enumsol.trusted.exclusion import Terms


class FormLeaves:
    """Forms as they are declared, and leaves that wait to be checked."""

    def __init__(self) -> None:
        self.declared: list[DeclaredForm] = []
        self._waiting: dict[int, list[tuple[int, tuple[int, ...], Terms]]] = {}

    def __len__(self) -> int:
        return sum(map(len, self._waiting.values()))

    def add(self, number: int, codes: tuple[int, ...], said: ExcludedByForm) -> None:
        """Take a leaf, to be checked with others."""
        place = len(self.declared) - said.back
        self._waiting.setdefault(place, []).append((number, codes, said.terms))

    def clear(self) -> None:
        """Let go of the leaves that wait."""
        self._waiting.clear()

    def failing(self, system: EnclosedSystem) -> list[int]:
        """Check the leaves that wait, form by form; the numbers of those that are not excluded."""
        failed: list[int] = []
        for place, leaves in self._waiting.items():
            declared = self.declared[place]
            numbers, codes, terms = zip(*leaves, strict=True)
            with np.errstate(over="ignore", invalid="ignore"):
                form = EnclosedForm.of(system, declared.codes, declared.multipliers, declared.weight)
                margins = exclusion_margins(form, Leaves.of(codes, terms))
            failed += np.array(numbers)[~(margins > 0)].tolist()
        return sorted(failed)
