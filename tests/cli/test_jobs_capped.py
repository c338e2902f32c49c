"""Line 10: `--jobs 1000000` is capped, with a word."""

import pytest
from command_line import assert_refused, run
from loky import ProcessPoolExecutor

from enumsol.cli import common


@pytest.fixture
def three_processors(monkeypatch):
    monkeypatch.setattr(common, "processors", lambda: 3)


@pytest.fixture
def started(monkeypatch):
    """Sizes of the pools that are made, none of which has more than one process."""
    sizes = []

    def pool(size, **options):
        sizes.append(size)
        return ProcessPoolExecutor(1, **options)

    monkeypatch.setattr("loky.ProcessPoolExecutor", pool)
    return sizes


ROOTS = ("roots", "gallery:one-node-6.1", "--alpha", 5)
TABLE = ("table", "gallery:one-node-6.1", "--alphas", "1,2")


@pytest.mark.slow
@pytest.mark.parametrize("verb", [ROOTS, TABLE])
def test_more_jobs_than_processors(capsys, three_processors, started, verb):
    status, out, err = run(capsys, *verb, "--jobs", 1_000_000)
    assert status == 0
    assert "complete: yes" in out
    assert started == [3]
    assert err == "enumsol: note: --jobs is 1000000; 3 are used, as many as this machine can keep busy\n"


@pytest.mark.parametrize("jobs", [2, 3])
def test_as_many_jobs_as_there_are_processors_need_no_word(capsys, three_processors, started, jobs):
    status, _, err = run(capsys, *ROOTS, "--jobs", jobs)
    assert (status, err, started) == (0, "", [jobs])


def test_windows_waits_for_no_more_than_61(capsys, monkeypatch):
    monkeypatch.setattr(common, "processors", lambda: 128)
    assert common.capped(100) == 100
    monkeypatch.setattr(common.sys, "platform", "win32")
    assert common.capped(100) == 61
    assert capsys.readouterr().err.startswith("enumsol: note: --jobs is 100; 61 are used, ")


def test_a_system_that_starts_no_more_processes(capsys, monkeypatch, three_processors):
    class Refusing(ProcessPoolExecutor):
        def submit(self, *_):
            raise BlockingIOError(11, "Resource temporarily unavailable")

    monkeypatch.setattr("loky.ProcessPoolExecutor", Refusing)
    found = run(capsys, *ROOTS, "--jobs", 2)
    assert_refused(*found, "--jobs is 2", "starts no more processes (Resource temporarily unavailable)")
