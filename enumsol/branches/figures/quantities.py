"""What is drawn against alpha: forces and displacements of single nodes, and overviews of the whole body."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from enumsol.support.arguments import one_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]


class Quantity(NamedTuple):
    """A quantity of a solution: in words, "force" or "length", and whether it is one of every contact node."""

    name: str
    words: str
    dimension: str
    by_node: bool


#: By their names; the first is drawn when none is asked for.
QUANTITIES = {
    item.name: item
    for item in (
        Quantity("norm", "norm of all contact forces", "force", by_node=False),
        Quantity("sum_n", "sum of normal forces", "force", by_node=False),
        Quantity("sum_t", "sum of tangential forces", "force", by_node=False),
        Quantity("lambda_n", "normal force", "force", by_node=True),
        Quantity("lambda_t", "tangential force", "force", by_node=True),
        Quantity("u_n", "normal displacement", "length", by_node=True),
        Quantity("u_t", "tangential displacement", "length", by_node=True),
    )
}


def quantity_of(name: Any) -> Quantity:
    """The quantity of that name.

    Raises
    ------
    InvalidArgumentError
        There is none; the message lists them.
    """
    return QUANTITIES[one_of(name, "quantity", QUANTITIES)]


def columns(quantity: Quantity, forces: Floats, moves: Floats) -> Floats:
    """Values at solutions, shape (..., p), or (..., 1) of an overview, from lambda and w of shape (..., 2p)."""
    p = forces.shape[-1] // 2
    if quantity.name == "norm":
        return np.asarray(np.linalg.norm(forces, axis=-1, keepdims=True))
    part = moves if quantity.dimension == "length" else forces
    half = part[..., :p] if quantity.name.endswith("_n") else part[..., p:]
    return half if quantity.by_node else np.sum(half, axis=-1, keepdims=True)


def state_columns(quantity: Quantity, state: Any) -> Floats:
    """The same of a vertex, or of another state with lambda_n, lambda_t, u_n and u_t."""
    return columns(quantity, np.concatenate([state.lambda_n, state.lambda_t]), np.concatenate([state.u_n, state.u_t]))
