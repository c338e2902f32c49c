"""Branches of solutions over alpha: arcs glued to a graph, multiplicity tables, linked samples (theory, section 7)."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
