"""The application: its commands, exit statuses and the one sentence that a mistake is answered with."""

from __future__ import annotations

import difflib
import re
import sys
import warnings
from collections.abc import Sequence
from typing import Annotated, Any, cast

import typer

from enumsol.cli.common import ExitStatus
from enumsol.cli.follow import fixed_point, follow
from enumsol.cli.graph import audit, graph, report, verify
from enumsol.cli.history import history
from enumsol.cli.options import add_command
from enumsol.cli.problems import collection_app, gallery_app
from enumsol.cli.progress import guarded_streams, loud_again, say
from enumsol.cli.roots import roots, table
from enumsol.cli.solve import solve
from enumsol.errors import EnumsolError, OutputError
from enumsol.support.messages import listed

#: Raised on options that typer cannot make sense of; it comes with click or with typer, by the version of typer.
_UsageError: type[Exception] = typer.BadParameter.__bases__[0]

app = typer.Typer(
    name="enumsol",
    help="Every equilibrium of a discrete contact problem with Coulomb friction.",
    epilog="Start with: enumsol gallery list",
    pretty_exceptions_enable=False,
    rich_markup_mode="markdown",
    context_settings={"help_option_names": ["-h", "--help"]},
)
for _command in (solve, roots, table, graph, history, report, follow, audit, fixed_point, verify):
    add_command(app, _command)
app.add_typer(gallery_app, name="gallery")
app.add_typer(collection_app, name="collection")


def _version(value: bool) -> None:
    if value:
        from enumsol import __version__  # found when it is asked for

        say(f"enumsol {__version__}")
        raise typer.Exit


@app.callback(invoke_without_command=True)
def _enumsol(
    context: typer.Context,
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    if context.invoked_subcommand is None:
        say(context.get_help())


def run(arguments: Sequence[str] | None = None) -> int:
    """Run a command and return its exit status.

    Parameters
    ----------
    arguments : sequence of str, optional
        Default: those of the process.
    """
    with guarded_streams(), loud_again(), warnings.catch_warnings():
        warnings.showwarning = _show_warning
        try:
            status = app(arguments, prog_name="enumsol", standalone_mode=False)
            sys.stdout.flush()
        except OutputError as error:
            left = isinstance(error.__cause__, BrokenPipeError)
            return _refuse(str(error), ExitStatus.BROKEN_PIPE if left else ExitStatus.OUTPUT_FAILED)
        except (KeyboardInterrupt, typer.Abort):
            return ExitStatus.INTERRUPTED
        except MemoryError as error:
            known = isinstance(error, EnumsolError)
            what = str(error) if known else "the memory does not suffice; expected a smaller problem or more memory"
            return _refuse(what, ExitStatus.OUT_OF_MEMORY)
        except EnumsolError as error:
            return _refuse(str(error))
        except _UsageError as error:
            return _refuse(_in_a_sentence(cast("typer.BadParameter", error)))
    return int(status or 0)


def _in_a_sentence(error: typer.BadParameter) -> str:
    """Sentence on what typer could not make sense of, and what it would accept."""
    option = getattr(error, "option_name", None)
    if isinstance(error.__cause__, ValueError) and hasattr(error.__cause__, "errors"):
        return _value_refused(error, error.__cause__.errors()[0])
    if option is None or error.ctx is None or not hasattr(error, "possibilities"):
        # several sentences: "No such command 'rots'. Did you mean 'roots'?"
        return str(error.format_message()).replace(". Did", "; did")
    options = [name for parameter in error.ctx.command.params for name in parameter.opts if name.startswith("--")]
    # likeness from which an option counts as misspelt: --alpha is no --graph
    close = difflib.get_close_matches(option.lstrip("-"), [name[2:] for name in options], n=1, cutoff=0.65)
    return f"no such option: {option}; " + (
        f"did you mean --{close[0]}?" if close else f"expected some of {listed(options)}"
    )


#: What was expected where pydantic, which reads values for newer versions of typer, refuses one, by its kinds.
_EXPECTED = {
    "int_parsing": "a whole number",
    "int_parsing_size": "a whole number of fewer digits",
    "int_from_float": "a whole number",
    "float_parsing": "a number",
    "greater_than_equal": "at least {ge}",
}


def _value_refused(error: typer.BadParameter, told: dict[str, Any]) -> str:
    """Sentence on the value of an option, from what pydantic says of it."""
    names = [] if error.param is None else error.param.opts
    name = next((name for name in names if name.startswith("--")), "an argument")
    # of a choice it has the words of typer: "Value error, 'foo' is not one of 'tree', 'exhaustive'."
    choices = re.search(r"not (one of .*?)\.?$", told["msg"])
    known = _EXPECTED.get(told["type"], "what it takes ({msg})").format(msg=told["msg"], **told.get("ctx", {}))
    return f"{name} is {told['input']!r}; expected {choices[1] if choices else known}"


#: Names in Python that messages of the library use, and their names on the command line.
_CALLED = (
    (r"\bbranch_graph\b", "enumsol graph"),
    (r"\bhistories(?= cannot)", "enumsol history"),
    (r"\bmultiplicity_table\b", "enumsol table"),
    (r"\benumerate_roots\b", "enumsol roots"),
    (r" \(rigid_modes is given\)", ""),
    (r'\barithmetic(?:=| )"(\w+)"', r"--arithmetic \1"),
    (r'\barithmetic is "(\w+)"', r"--arithmetic is \1"),
    (r"^time_limit is (.*) or None$", r"--time-limit is \1"),
    (r"^proof_path (?=.*resumed$)", "--proof "),
    (r"^merge is", "--merge is"),
    (r"^step is (?=\d+; expected one of)", "--step is "),
    (r"\bor step, the number\b", "or --step, the number"),
    (r"or (an fclib file .*) \(enumsol\.fem makes problems .*\)$", r"\1, a deck (.inp) or a .toml file of a mesh"),
)


def _refuse(message: str, status: ExitStatus = ExitStatus.BAD_INPUT) -> ExitStatus:
    sentence = " ".join(message.split()).rstrip(".")
    for name, here in _CALLED:
        sentence = re.sub(name, here, sentence)
    # quotes, names and capitals of our own messages stay as they are
    if sentence.startswith(("Missing ", "No such ", "Invalid ", "Got ", "Option ")):
        sentence = sentence[0].lower() + sentence[1:]
    say(f"enumsol: error: {sentence}", err=True)
    return status


def _show_warning(message: Warning | str, *_: object, **__: object) -> None:
    say(f"enumsol: warning: {' '.join(str(message).split())}", err=True)
