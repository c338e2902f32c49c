"""The proof of which roots run away: the proof of the roots, and certificates for every one of them."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING

import numpy as np

from enumsol.errors import InvalidArgumentError
from enumsol.model.mesh import mass_fingerprint
from enumsol.model.statuses import ContactStatus
from enumsol.proof.proof_file import PROOF_VERSION
from enumsol.proof.stability_records import DOES_NOT, RUNS_AWAY, UNDECIDED, VERDICTS, certificate_record, root_record
from enumsol.proof.writer import ProofWriter

if TYPE_CHECKING:
    from collections.abc import Iterable
    from pathlib import Path
    from typing import Any

    from enumsol.proof.proof_file import Proof
    from enumsol.roots.root import Root
    from enumsol.roots.stability import Stabilities, Stability


def write_proof(
    proof: Proof, roots: Iterable[Root], asked: Stabilities, found: Iterable[Stability], path: str | Path | None
) -> Proof:
    """The proof of verdicts ``found`` on roots, after the ``proof`` of these.

    Raises
    ------
    InvalidArgumentError
        The file cannot be written.
    """
    # the new proof may take the place of the file
    records, problem = list(proof.records()), asked.problem
    writer = ProofWriter(path)
    writer.write(
        {
            "format": "enumsol-proof",
            "version": PROOF_VERSION,
            "kind": "stability",
            "problem": problem.fingerprint,
            "p": problem.p,
            "mass": mass_fingerprint(asked.body.mass),
        }
    )
    for record in records:
        writer.write(record)
    counts: Counter[str] = Counter()
    for root, own in zip(roots, found, strict=True):
        verdict, certificates = _certified(asked, root, own)
        counts[verdict] += 1
        writer.write(root_record(np.concatenate([root.lambda_n, np.asarray(root.lambda_t).T.ravel()]), verdict))
        for record in certificates:
            writer.write(record)
    writer.write({"roots": counts.total(), **{verdict: counts[verdict] for verdict in VERDICTS}})
    written = writer.close()
    if writer.failure is not None:
        raise InvalidArgumentError(writer.failure)
    return written


def _certified(asked: Stabilities, root: Root, found: Stability) -> tuple[str, list[Any]]:
    """Verdict that follows from the proof of the roots alone, and the records of its certificates."""
    if found.verdict == UNDECIDED or not _strict(root):
        return UNDECIDED, []
    parts = list(asked.examined(root))
    if found.verdict == RUNS_AWAY:
        growing = ((k, proven.growing[0]) for k, (_, proven) in enumerate(parts) if proven.growing)
        k, (certificate, _) = max(growing, key=lambda item: item[1][0].low)
        return RUNS_AWAY, [certificate_record(k, certificate)]
    records = []
    for k, (_, proven) in enumerate(parts):
        records += [certificate_record(k, leaf) for leaf in dict.fromkeys(proven.leaves)]
    return DOES_NOT, records


def _strict(root: Root) -> bool:
    """True if every node with a choice has one status, and surely touches or not."""
    return all(len(held) == 1 or ContactStatus.OPEN not in held for held in root.active) and (
        root.regular or all(len(held) == 1 for held in root.active)
    )
