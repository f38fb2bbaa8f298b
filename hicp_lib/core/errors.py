"""The one exception the library raises for bad input."""


class InputError(ValueError):
    """Something read from outside is not what was expected.

    The message is one line that names the file (and the row or key), what was
    expected, and what to do about it. The command line prints it and exits 2.
    """
