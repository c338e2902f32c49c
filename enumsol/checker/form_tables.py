"""Forms declared in a proof, and the leaves that they exclude (docs/proof_format.md, under Forms)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from enumsol.proof.form_records import DeclaredForm
from enumsol.proof.reading import RefusedError, multipliers_from
from enumsol.trusted.quadratic_forms import EnclosedForm, form_margins
from enumsol.trusted.status_rows import ROW_KINDS

if TYPE_CHECKING:
    from enumsol.condensation.enclosure import EnclosedSystem

_LEAF = 4


class FormLeaves:
    """Forms as they are declared, and leaves that wait to be checked."""

    def __init__(self) -> None:
        self._declared: list[DeclaredForm] = []
        self._waiting: dict[int, list[tuple[int, tuple[int, ...], Any, Any]]] = {}

    def __len__(self) -> int:
        return sum(map(len, self._waiting.values()))

    def declare(self, record: list[Any], p: int) -> None:
        """Read a form.

        Raises
        ------
        RefusedError
            The record makes no sense.
        """
        try:
            self._declared.append(DeclaredForm.read(record, p))
        except ValueError as error:
            raise RefusedError(str(error)) from None

    def add(self, number: int, codes: tuple[int, ...], record: list[Any]) -> str | None:
        """Take a leaf, to be checked with others; the reason when it proves nothing."""
        if len(record) != _LEAF:
            return f"its record has {len(record)} entries; expected {_LEAF}"
        back = record[1]
        if type(back) is not int or not 1 <= back <= len(self._declared):
            return "its form was not declared"
        place = len(self._declared) - back
        if not self._declared[place].holds(codes):
            return "its form was made for another assignment"
        rows, values = multipliers_from(record[2:], ROW_KINDS * len(codes))
        self._waiting.setdefault(place, []).append((number, codes, rows, values))
        return None

    def clear(self) -> None:
        """Let go of the leaves that wait."""
        self._waiting.clear()

    def failing(self, system: EnclosedSystem) -> list[int]:
        """Check the leaves that wait, form by form; the numbers of those that are not excluded."""
        failed: list[int] = []
        for place, leaves in self._waiting.items():
            declared = self._declared[place]
            numbers, codes, rows, values = zip(*leaves, strict=True)
            leaf = np.repeat(np.arange(len(rows)), [len(r) for r in rows])
            with np.errstate(over="ignore", invalid="ignore"):
                form = EnclosedForm.of(system, declared.codes, declared.multipliers, declared.weight)
                margins = form_margins(
                    form, np.array(codes, dtype=np.intp), leaf, np.concatenate(rows), np.concatenate(values)
                )
            failed += np.array(numbers)[~(margins > 0)].tolist()
        return sorted(failed)
