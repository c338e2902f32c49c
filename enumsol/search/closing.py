"""Closers: proposals for certificates that leave a subtree one solution, or none, so that it need not be split.

Nothing here is trusted: the certifier proves what is proposed, or the tree is searched.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Callable

    from enumsol.relaxation.engine import Relaxation
    from enumsol.search.certifiers.protocol import Bound, Led
    from enumsol.search.fathoming_in_contact import LoneProposal
    from enumsol.support.array_types import Codes


class TreeCloser:
    """Base of the closers of a tree: this one closes nothing.

    Attributes
    ----------
    known : a root that was found before, or what else workers are to know; None where nothing is
    sliding : dict
        FORWARD or BACKWARD for nodes that slide without load as far as is known; they are branched on last.
    relaxed : callable
        Gives the relaxation of an assignment with the energy, if it is solved; the search sets it.
    """

    def __init__(self) -> None:
        self.known: Any = None
        self.sliding: dict[int, int] = {}
        self.relaxed: Callable[[Codes], Relaxation | None] = lambda _: None

    def whole(self) -> list[Any] | None:
        """All solutions of the problem, if one certificate proves that there is one only."""
        return None

    @property
    def leads(self) -> bool:
        """True if `led` decides some nodes of the tree."""
        return False

    def led(self, codes: Codes) -> Led | None:
        """Solutions below an assignment before its relaxation is solved, or else the node to split and how; or None."""
        del codes
        return None

    def closed(self, codes: Codes, relaxation: Relaxation | None) -> list[Any] | None:
        """The solutions of a subtree that can be closed, None where it has to be searched."""
        del codes, relaxation
        return None

    def again(self, codes: Codes, relaxation: Relaxation | None) -> list[Any] | None:
        """The solutions of a subtree that was closed in an earlier search."""
        return self.closed(codes, relaxation)

    def alone(self, codes: Codes, proposal: LoneProposal, bound: Bound) -> list[Any] | None:
        """The root of what an earlier search proposed, if it is proven to be the only one; None if not."""
        del codes, proposal, bound
        return None

    def met(self, answer: object) -> None:
        """Take note of what a complete selection holds."""

    def begins_again(self, nodes: int) -> bool:
        """True if so much has become known after some nodes that a search had better begin again."""
        del nodes
        return False
