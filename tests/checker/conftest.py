"""Set-up of the tests of the checker."""

import pytest


@pytest.fixture(autouse=True)
def _enclosed_once(enclosed_once):
    """Proofs of one problem, again and again."""
