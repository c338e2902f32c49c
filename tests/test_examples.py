"""Examples in docstrings: every one runs and prints what it says, and every public name has one."""

import doctest
import inspect
from importlib import import_module
from pkgutil import walk_packages

import pytest

import enumsol

FLAGS = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE | doctest.IGNORE_EXCEPTION_DETAIL


def examples():
    """Every docstring with examples, by its full name; an example sees nothing but what it imports."""
    finder = doctest.DocTestFinder(exclude_empty=True)
    names = [module.name for module in walk_packages(enumsol.__path__, "enumsol.")]
    for name in ("enumsol", *names):
        if name.rpartition(".")[2].startswith("_"):
            continue  # compiled modules, and what `python -m` runs
        yield from (test for test in finder.find(import_module(name), name, globs={}) if test.examples)


def run(test):
    """What doctest has to say against it."""
    said = []
    doctest.DocTestRunner(optionflags=FLAGS).run(test, out=said.append, clear_globs=False)
    return "".join(said)


TESTS = {test.name: test for test in examples()}


@pytest.mark.few(21)
@pytest.mark.parametrize("name", sorted(TESTS))
def test_example(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    said = run(TESTS[name])
    assert not said, said


def is_error(thing):
    return inspect.isclass(thing) and issubclass(thing, Exception)


def own_functions(module):
    functions = vars(module).values()
    functions = [f for f in functions if inspect.isfunction(f) and f.__module__.startswith(module.__name__)]
    return [f for f in functions if not f.__name__.startswith("_")]


#: Of the errors EnumsolError alone has to show how they are caught.
PUBLIC = [value for name in enumsol.__all__ if hasattr(value := getattr(enumsol, name), "__module__")]
SHOWN = [thing for thing in PUBLIC if not inspect.ismodule(thing) and not is_error(thing)]
SHOWN += [enumsol.EnumsolError, *own_functions(enumsol.gallery), *own_functions(enumsol.fem)]


@pytest.mark.parametrize("thing", SHOWN, ids=lambda thing: thing.__name__)
def test_every_public_name_has_an_example(thing):
    assert f"{thing.__module__}.{thing.__qualname__}" in TESTS


@pytest.mark.parametrize("line", ["1 + 1\n3", "missing", "import enumsol; enumsol.no_such_name"])
def test_an_example_that_is_wrong_is_found(line):
    wrong = doctest.DocTestParser().get_doctest(f">>> {line}\n", {}, "wrong", None, None)
    assert run(wrong)
