"""The command line ``enumsol``: one module a command, `enumsol.cli.app` joins them."""

from enumsol.cli.app import main

__all__ = ["main"]
