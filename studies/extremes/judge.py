"""Judging one extreme case: right, undecided with its reason, or wrong.

A verified answer is wrong when it claims completeness with another count, other statuses or other values than the
reference, when the checker refuses its proof or counts differently, when its degrees do not sum to one, or when
anything warns, fails or is not finite.
"""

from __future__ import annotations

import time
import warnings
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

import enumsol
from enumsol import ContactProblem, enumerate_roots, verify

if TYPE_CHECKING:
    from collections.abc import Callable
    from fractions import Fraction

RIGHT, UNDECIDED, WRONG = "right", "undecided", "wrong"
#: A search that takes longer than this is stopped and counts as undecided [seconds].
TIME_LIMIT = 20.0
#: The same for fast arithmetic, which is not what is judged here.
FAST_LIMIT = 3.0


@dataclass(frozen=True)
class Case:
    """One problem at one alpha, and what is known about it without the verified search.

    Attributes
    ----------
    group, name : str
    build : callable that makes the problem
    alpha : float or Fraction
    oracle : {"exhaustive", "exact", "closed form", "invariance", "none"}
        "exhaustive": all selections one by one in rationals. "exact": the tree search in rationals. "closed form": the
        count is ``expected``. "invariance": the verified roots of ``partner`` are the same ones. "none": only the
        proof, the degrees and the values are checked.
    expected : int or None
        Roots and families together; checked in addition where another oracle is named.
    partner : callable or None
        Makes an equivalent problem, together with the map from its statuses to those of this one.
    """

    group: str
    name: str
    build: Callable[[], ContactProblem]
    alpha: float | Fraction = 1.0
    oracle: str = "exact"
    expected: int | None = None
    partner: Callable[[ContactProblem], tuple[ContactProblem, Callable[[Any], Any]]] | None = None


@dataclass
class Finding:
    """What came of a case."""

    verdict: str = RIGHT
    reasons: list[str] = field(default_factory=list)
    roots: Any = ""
    fast: str = ""
    p: Any = ""
    n: Any = ""
    data: str = ""

    def wrong(self, reason: str) -> None:
        """Take note of something that must not be."""
        self.verdict = WRONG
        self.reasons.append(reason)

    def undecided(self, reason: str) -> None:
        """Take note of something that stayed open."""
        if self.verdict == RIGHT:
            self.verdict = UNDECIDED
        self.reasons.append(reason)


def judge(case: Case) -> dict[str, Any]:
    """One row of the study's table."""
    started = time.process_time()
    finding = guarded(lambda: _judge_roots(case))
    return row(case.group, case.name, case.oracle, finding, time.process_time() - started)


def row(group: str, name: str, oracle: str, finding: Finding, seconds: float) -> dict[str, Any]:
    """A row of the table."""
    return {
        "group": group,
        "case": name,
        "p": finding.p,
        "n": finding.n,
        "verdict": finding.verdict,
        "roots": finding.roots,
        "oracle": oracle,
        "reason": "; ".join(dict.fromkeys(finding.reasons))[:300],
        "fast": finding.fast,
        "seconds": seconds,
    }


def guarded(work: Callable[[], Finding]) -> Finding:
    """The finding, where a warning or an exception that is no message to the user counts as wrong."""
    finding = Finding()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            finding = work()
        except enumsol.EnumsolError as error:
            # the user is told what is wrong with the data; nothing is claimed
            finding.undecided(f"refused: {error}")
        except Warning as warning:
            finding.wrong(f"warning: {warning}")
        except Exception as error:  # noqa: BLE001 (the study exists to find them)
            finding.wrong(f"{type(error).__name__}: {error}")
    return finding


def signature(roots: Any) -> tuple[Any, ...]:
    """Statuses and degrees of all roots, and dimensions and degrees of all families."""
    singles = sorted((tuple(str(s) for s in root.statuses), root.index, root.regular) for root in roots)
    families = sorted((family.dimension, family.index or 0) for family in roots.families)
    return (tuple(singles), tuple(families))


def count(roots: Any) -> int:
    """Roots and families together."""
    return len(roots) + len(roots.families)


def _judge_roots(case: Case) -> Finding:
    problem = case.build()
    finding = Finding(p=problem.p, n=problem.n)
    roots = enumerate_roots(problem, case.alpha, time_limit=TIME_LIMIT)
    finding.roots, finding.data = count(roots), roots.certified_data
    check_values(problem, roots, finding)
    check_proof(problem, roots, finding)
    if not roots.complete:
        if roots.stopped is not None:
            finding.undecided(str(roots.stopped))
        for item in roots.undecided:
            finding.undecided(item.reason)
        if not finding.reasons:
            finding.wrong("not complete, and no reason is given")
    if case.expected is not None and roots.complete and count(roots) != case.expected:
        finding.wrong(f"{count(roots)} roots and families, known: {case.expected}")
    check_oracle(case, problem, roots, finding)
    finding.fast = _fast(problem, case, roots)
    return finding


def check_values(problem: ContactProblem, roots: Any, finding: Finding) -> None:
    """Everything finite, every root within its enclosure, degrees that sum to one."""
    for root in roots:
        values = np.concatenate([root.lambda_n, root.lambda_t, root.u_n, root.u_t])
        if not np.all(np.isfinite(values)):
            finding.wrong("a root is not finite")
            continue
        for name in ("lambda_n", "lambda_t", "u_n", "u_t"):
            bounds, value = getattr(root.enclosure, name), getattr(root, name)
            if not np.all((bounds[:, 0] <= value) & (value <= bounds[:, 1])):
                finding.wrong(f"{name} lies outside its enclosure")
        if np.any(root.lambda_n < 0) and root.regular:
            finding.wrong("a regular root has a negative normal force")
        if np.any(root.u_n > 0) and root.regular:
            finding.wrong("a regular root penetrates the foundation")
        if not root.margin >= 0:
            finding.wrong(f"margin {root.margin}")
    if roots.complete and roots.index_sum not in (1, None):
        finding.wrong(f"complete, with index sum {roots.index_sum}")


def check_proof(problem: ContactProblem, roots: Any, finding: Finding) -> None:
    """The checker accepts the proof and counts what the search counts."""
    if roots.proof is None:
        finding.wrong("no proof")
        return
    report = verify(problem, roots.proof)
    if not report.ok:
        finding.wrong(f"the checker refuses the proof: {report.failures[0]}")
    elif report.complete != roots.complete:
        finding.wrong(f"complete: {roots.complete}, by the checker: {report.complete}")
    elif roots.complete and (report.roots, report.families) != (len(roots), len(roots.families)):
        finding.wrong("the checker counts otherwise")


def check_oracle(case: Case, problem: ContactProblem, roots: Any, finding: Finding) -> None:
    """Compare with the reference that the case names."""
    if case.oracle in ("exhaustive", "exact"):
        method = "exhaustive" if case.oracle == "exhaustive" else "tree"
        truth = enumerate_roots(problem, case.alpha, "exact", method)
        _compare(roots, truth, finding)
    elif case.oracle == "invariance" and case.partner is not None and roots.complete:
        other, mapped = case.partner(problem)
        twin = enumerate_roots(other, case.alpha, time_limit=TIME_LIMIT)
        if twin.complete:
            mine = sorted(tuple(str(s) for s in root.statuses) for root in roots)
            theirs = sorted(tuple(mapped([str(s) for s in root.statuses])) for root in twin)
            if mine != theirs or len(roots.families) != len(twin.families):
                finding.wrong("an equivalent problem has other roots")
        else:
            finding.reasons.append("the equivalent problem stayed undecided")


def _compare(roots: Any, truth: Any, finding: Finding) -> None:
    """Verified roots against exact ones: the same where complete, no invented ones where not."""
    exact = {tuple(root.statuses): root for root in truth}
    for root in roots:
        other = exact.get(tuple(root.statuses))
        if other is None:
            finding.wrong("a root is listed that is none")
            continue
        for name in ("lambda_n", "lambda_t", "u_n", "u_t"):
            mine, theirs = getattr(root.enclosure, name), getattr(other.enclosure, name)
            if not np.all((mine[:, 0] <= theirs[:, 1]) & (theirs[:, 0] <= mine[:, 1])):
                finding.wrong(f"the enclosure of {name} misses the exact root")
    if roots.complete and signature(roots) != signature(truth):
        finding.wrong(f"complete with {count(roots)}, exact arithmetic finds {count(truth)} (or other degrees)")


def _fast(problem: ContactProblem, case: Case, roots: Any) -> str:
    """What fast arithmetic makes of the case, against the verified answer: it may be off and never claims otherwise."""
    try:
        fast = enumerate_roots(problem, case.alpha, "fast", time_limit=FAST_LIMIT)
    except enumsol.EnumsolError as error:
        return f"refused ({type(error).__name__})"
    if fast.stopped is not None:
        return "stopped"
    if not roots.complete:
        return f"{count(fast)} roots"
    return "same" if signature(fast) == signature(roots) else f"off: {count(fast)}"
