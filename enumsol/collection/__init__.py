"""Contact problems with certified numbers of solutions, for testing solvers: problems, solutions, proofs, and a check.

`COLLECTION` lists them by name; `get` finds one. Friction and load of each are fixed, its list of solutions is
complete, and a proof comes with it. `check` says which of them a solver found, which it missed, and which of its
answers are spurious; `export` writes everything to a folder. docs/collection.md has the table, and the formats that
`check` reads.
"""

from enumsol.collection.comparison import CollectionReport, JudgedSolution, ProblemReport, check
from enumsol.collection.entries import COLLECTION, CertifiedSolutions, CollectionEntry, export, get

__all__ = [
    "COLLECTION",
    "CertifiedSolutions",
    "CollectionEntry",
    "CollectionReport",
    "JudgedSolution",
    "ProblemReport",
    "check",
    "export",
    "get",
]
