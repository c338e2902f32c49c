"""Roots at one alpha: enumerated, joined to families, counted with their degrees."""
