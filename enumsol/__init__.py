"""Enumerate and account for every solution of a discrete contact problem with Coulomb friction.

The public names stand in ``__init__.pyi``. A module is loaded when a name of it is first used, so that a program loads
what it works with and no more: sparse matrices come with a problem, networkx and rational arithmetic with a graph.
"""

try:
    import lazy_loader

    __getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
except KeyboardInterrupt:
    import os
    import sys

    # the command, or python -m enumsol: as in enumsol.cli
    if os.path.basename(sys.argv[0]).partition(".")[0] in ("enumsol", "-m"):
        sys.exit(130)
    raise
