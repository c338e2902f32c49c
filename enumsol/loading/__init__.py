"""Histories of loading: every sequence of solutions that steps of load and friction may leave behind."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
