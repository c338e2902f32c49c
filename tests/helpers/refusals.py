"""What a call refuses: which error it raises, what it says, and that it says it as all errors of the package do."""

import pytest

from enumsol import EnumsolError, InvalidArgumentError, InvalidProblemError


def refusal(kind, message, call, /, *arguments, **options):
    """The error of this very kind that the call raises with this message (a pattern): one sentence, in one line."""
    with pytest.raises(kind, match=message) as caught:
        call(*arguments, **options)
    text = str(caught.value)
    assert isinstance(caught.value, EnumsolError)
    assert "\n" not in text
    assert not text.endswith(".")
    return caught.value


def bad_argument(message, call, /, *arguments, **options):
    """The call says what is wrong with an argument."""
    return refusal(InvalidArgumentError, message, call, *arguments, **options)


def bad_problem(message, call, /, *arguments, **options):
    """The call says what is wrong with a problem or its file."""
    return refusal(InvalidProblemError, message, call, *arguments, **options)
