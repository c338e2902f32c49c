"""The named arrays of a problem: what a file holds, checked name by name, and the problem they make."""

from __future__ import annotations

import difflib
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import numpy as np

from enumsol.errors import InvalidProblemError
from enumsol.problem import ContactProblem

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Iterator, Mapping

    from numpy.typing import NDArray

#: Version of the layout that is written, and the newest that can be read.
FORMAT_VERSION = 1

MATRICES = ("A", "Bn", "Bt")
REQUIRED = (*MATRICES, "f")
FRICTION = ("friction", "friction0", "friction1")
OPTIONAL = ("gap", *FRICTION, "load_slope", "slip_offset", "node_ids", "coordinates")
KNOWN = (*REQUIRED, *OPTIONAL)

#: Names in use elsewhere for the same things, lower case and without underscores.
_SYNONYMS = {
    "a": "A",
    "k": "A",
    "stiffness": "A",
    "bn": "Bn",
    "n": "Bn",
    "normal": "Bn",
    "bt": "Bt",
    "t": "Bt",
    "tangential": "Bt",
    "f": "f",
    "b": "f",
    "rhs": "f",
    "load": "f",
    "force": "f",
    "forces": "f",
    "g": "gap",
    "gap0": "gap",
    "mu": "friction",
    "f0": "friction0",
    "mu0": "friction0",
    "f1": "friction1",
    "mu1": "friction1",
    "dload": "load_slope",
    "nodes": "node_ids",
    "labels": "node_ids",
    "points": "coordinates",
    "coords": "coordinates",
}


@contextmanager
def refusing(errors: tuple[type[Exception], ...], found: str, expected: str) -> Iterator[None]:
    """Turn what other packages raise on unusable files into one sentence: ``found (reason); expected ...``."""
    try:
        yield
    except InvalidProblemError:
        raise
    except errors as error:
        reason = str(error).strip().split("\n")[0].split(". ")[0].rstrip(" .:") or type(error).__name__
        raise InvalidProblemError(f"{found} ({reason}); expected {expected}") from error


def check_names(found: Collection[str], suffix: str = "") -> None:
    """Raise InvalidProblemError for arrays that are missing, unknown or contradict each other.

    Parameters
    ----------
    found : names of the arrays in the file, without the private ones
    suffix : what follows a name in messages: "" for arrays, ".mtx" for files
    """
    strangers = [name for name in found if name not in KNOWN]
    missing = [name for name in REQUIRED if name not in found]
    if missing:
        meant = {name: _closest(name, strangers) for name in missing}
        hints = "".join(f"; is {other}{suffix} meant as {name}{suffix}?" for name, other in meant.items() if other)
        raise InvalidProblemError(
            f"{_listing(missing, suffix)} {'is' if len(missing) == 1 else 'are'} missing "
            f"(found {_listing(found, suffix) or 'nothing'}{hints}); expected {_listing(REQUIRED, suffix)}"
        )
    if strangers:
        close = _closest_known(strangers[0])
        hint = f" (is {close}{suffix} meant?)" if close else ""
        raise InvalidProblemError(
            f"{strangers[0]}{suffix} is not known{hint}; expected {_listing(KNOWN)}, "
            "or a name that begins with an underscore for what enumsol is to ignore"
        )
    if "friction" in found and ("friction0" in found or "friction1" in found):
        raise InvalidProblemError(
            f"friction{suffix} is given together with friction0 or friction1; "
            "expected a constant coefficient (friction) or F = friction0 + alpha friction1, not both"
        )


def problem_from_arrays(arrays: Mapping[str, Any]) -> ContactProblem:
    """The problem made of arrays whose names have been checked."""
    options: dict[str, Any] = {
        name: arrays[name] for name in ("gap", "load_slope", "slip_offset", "coordinates") if name in arrays
    }
    if "friction" in arrays:
        constant = np.asarray(arrays["friction"])
        if constant.ndim:
            raise InvalidProblemError(
                f"friction is an array of shape {constant.shape}, which is ambiguous; expected one number, "
                "or friction0 and friction1, each a number or an array of shape (p,)"
            )
        options["friction"] = (constant, 0.0)
    elif "friction0" in arrays or "friction1" in arrays:
        options["friction"] = (arrays.get("friction0", 0.0), arrays.get("friction1", 0.0))
    if "node_ids" in arrays:
        options["node_ids"] = arrays["node_ids"]
    return ContactProblem(*(arrays[name] for name in REQUIRED), **options)


def vectors_of(problem: ContactProblem) -> dict[str, NDArray[np.float64]]:
    """All arrays of numbers of a problem but its matrices, by the names they have in files."""
    F0, F1 = problem.friction
    arrays = {"f": problem.f, "gap": problem.gap, "friction0": F0, "friction1": F1, "slip_offset": problem.slip_offset}
    if problem.load_slope is not None:
        arrays["load_slope"] = problem.load_slope
    if problem.coordinates is not None:
        arrays["coordinates"] = problem.coordinates
    return arrays


def _listing(names: Iterable[str], suffix: str = "") -> str:
    texts = [name + suffix for name in names]
    if len(texts) > 14:
        texts = [*texts[:12], f"{len(texts) - 12} more"]
    return " and ".join([", ".join(texts[:-1]), texts[-1]] if len(texts) > 1 else texts)


def _plain(name: str) -> str:
    return "".join(c for c in name.casefold() if c.isalnum())


def _closest(wanted: str, names: Iterable[str]) -> str | None:
    """The name among ``names`` that most likely means ``wanted``."""
    return next((name for name in names if _closest_known(name) == wanted), None)


def _closest_known(name: str) -> str | None:
    plain = _plain(name)
    if plain in _SYNONYMS:
        return _SYNONYMS[plain]
    known = {_plain(other): other for other in KNOWN}
    close = difflib.get_close_matches(plain, known, n=1, cutoff=0.6)
    return known[close[0]] if close else None
