"""What tests of the code of studies import is in their folder."""

from pathlib import Path

import pytest


@pytest.fixture(autouse=True)
def studies(monkeypatch):
    monkeypatch.syspath_prepend(Path(__file__).parents[2] / "studies")
