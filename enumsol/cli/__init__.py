"""The command line ``enumsol``: a function for each command, which `enumsol.cli.app` joins."""

from __future__ import annotations

TYPE_CHECKING = False  # typing takes a while to load
if TYPE_CHECKING:
    from collections.abc import Sequence

__all__ = ["main"]


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit status, also on Ctrl-C while its modules are loaded.

    Parameters
    ----------
    arguments : sequence of str, optional
        Default: those of the process.
    """
    try:
        from enumsol.cli.app import run

        return run(arguments)
    except KeyboardInterrupt:
        return 130  # ExitStatus.INTERRUPTED, whose module may not be loaded
