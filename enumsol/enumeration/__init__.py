"""Enumeration of all solutions at one alpha: tree search, relaxation, exhaustive oracle, roots and families."""

from enumsol.enumeration.enumerate import enumerate_roots
from enumsol.enumeration.tree import SearchProgress

__all__ = ["SearchProgress", "enumerate_roots"]
