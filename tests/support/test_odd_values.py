"""Values that can hardly be shown, names that no file has, and errors of workers, in messages."""

import os

import pytest
from refusals import bad_argument

from enumsol.cli import common
from enumsol.support.arguments import file_path, shown
from enumsol.support.workers import _one_line


class Faulty:
    def __repr__(self):
        raise ValueError("nothing to show")


def test_what_cannot_be_written_is_shown_by_its_type():
    assert shown(Faulty()) == "<Faulty>" or shown(Faulty()).startswith("<Faulty instance at")
    nested = []
    nested.append(nested)
    assert "..." in shown(nested)
    assert len(shown(10**10_000)) < 200


@pytest.mark.parametrize(
    ("name", "why"),
    [
        ("", "path is an empty text"),
        ("a\0b", "a character that no name has"),
        ("\ud800", "a character that no name has"),
    ],
)
def test_what_no_file_is_called(name, why):
    bad_argument(why, file_path, name, "path")


def test_errors_of_workers_are_one_line():
    assert _one_line(ValueError()) == "ValueError"
    assert _one_line(ValueError("first\n  second.")) == "first second"
    long = _one_line(OSError("x" * 10_000))
    assert long.startswith("OSError, xxx")
    assert long.endswith("xxx ...")
    assert len(long) < 1000


def test_processors_are_those_that_the_process_may_use(monkeypatch):
    assert 1 <= common.processors() <= (os.cpu_count() or 1)
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: {0, 3, 5}, raising=False)
    assert common.processors() == 3
    monkeypatch.delattr(os, "sched_getaffinity")
    monkeypatch.setattr(os, "cpu_count", lambda: None)
    assert common.processors() == 1
