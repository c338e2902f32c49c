"""Bare `enumsol` prints help."""

import pytest
from command_line import call


@pytest.mark.few(1)
@pytest.mark.parametrize("group", [(), ("gallery",)])
def test_it_is_the_help_on_stdout(group):
    bare, asked = call(*group), call(*group, "--help")
    assert (bare.returncode, bare.stderr) == (0, "")
    assert bare.stdout.rstrip() == asked.stdout.rstrip()
    assert "Usage: enumsol" in bare.stdout
