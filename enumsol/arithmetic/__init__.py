"""Exact and enclosed numbers: rationals, real algebraic numbers, number fields, balls."""
