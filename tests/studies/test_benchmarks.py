"""The benchmarks do what they time; nothing is timed here."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

import enumsol

HERE = Path(__file__).parent
ROOT = HERE.parents[1]


@pytest.mark.slow
def test_every_benchmark_runs_once(tmp_path):
    command = [sys.executable, "-m", "pytest", "studies/benchmarks", "-n", "0", "-p", "no:benchmark", "-p", "once"]
    path = os.pathsep.join((str(HERE), str(Path(enumsol.__file__).parents[1])))
    environment = {**os.environ, "OMP_NUM_THREADS": "1", "PYTHONPATH": path}
    environment.pop("PYTEST_ADDOPTS", None)  # which was said of this run, not of the one within
    done = subprocess.run(
        [*command, "-o", f"cache_dir={tmp_path}"], cwd=ROOT, env=environment, capture_output=True, text=True,
        check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout
    assert " passed" in done.stdout
    assert "skipped" not in done.stdout
