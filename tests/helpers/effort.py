"""How many random cases a test takes: some in every run, all of them where the long tests run as well."""

#: Set by conftest: the long tests run, too.
thorough = False


def some(few, *, of):
    """That many of so many cases, or of what they are expected to show."""
    return of if thorough else few
