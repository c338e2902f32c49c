"""The application: its commands, exit statuses and the one sentence that a mistake is answered with."""

from __future__ import annotations

import contextlib
import os
import sys
import warnings
from typing import TYPE_CHECKING, Annotated

import typer

from enumsol.cli import audit, follow, gallery, graph, roots, table, verify
from enumsol.cli.common import ExitStatus
from enumsol.errors import EnumsolError

if TYPE_CHECKING:
    from collections.abc import Sequence

#: Raised on options that typer cannot make sense of; it comes with click or with typer, by the version of typer.
_UsageError: type[Exception] = typer.BadParameter.__bases__[0]

app = typer.Typer(
    name="enumsol",
    help="Every equilibrium of a discrete contact problem with Coulomb friction.",
    epilog="Start with: enumsol gallery list",
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode="markdown",
    context_settings={"help_option_names": ["-h", "--help"]},
)
app.command("roots")(roots.roots)
app.command("table")(table.table)
app.command("graph")(graph.graph)
app.command("follow")(follow.follow)
app.command("audit")(audit.audit)
app.command("verify")(verify.verify)
app.add_typer(gallery.app, name="gallery")


def _version(value: bool) -> None:
    if value:
        from importlib.metadata import PackageNotFoundError, version  # for nothing else

        try:
            found = version("enumsol")
        except PackageNotFoundError:
            found = "(not installed, run from its source)"
        typer.echo(f"enumsol {found}")
        raise typer.Exit


@app.callback(invoke_without_command=True)
def _enumsol(
    context: typer.Context,
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    if context.invoked_subcommand is None:
        typer.echo(context.get_help())


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit status.

    Parameters
    ----------
    arguments : sequence of str, optional
        Default: those of the process.
    """
    with warnings.catch_warnings():
        warnings.showwarning = _show_warning
        try:
            status = app(arguments, prog_name="enumsol", standalone_mode=False)
            sys.stdout.flush()
        except EnumsolError as error:
            return _refuse(str(error))
        except _UsageError as error:
            # several sentences: "No such command 'rots'. Did you mean 'roots'?"
            return _refuse(error.format_message().replace(". Did", "; did"))  # type: ignore[attr-defined]
        except BrokenPipeError:
            # whoever read our output has read enough (| head): keep the interpreter from complaining at exit
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
            return ExitStatus.BROKEN_PIPE
        except (KeyboardInterrupt, typer.Abort):
            return ExitStatus.INTERRUPTED
    return int(status or 0)


def _refuse(message: str) -> int:
    sentence = " ".join(message.split()).rstrip(".")
    # quotes, names and capitals of our own messages stay as they are
    if sentence.startswith(("Missing ", "No such ", "Invalid ", "Got ", "Option ")):
        sentence = sentence[0].lower() + sentence[1:]
    typer.echo(f"enumsol: error: {sentence}", err=True)
    return ExitStatus.BAD_INPUT


def _show_warning(message: Warning | str, *_: object, **__: object) -> None:
    with contextlib.suppress(OSError):
        typer.echo(f"enumsol: warning: {' '.join(str(message).split())}", err=True)
