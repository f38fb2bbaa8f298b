"""The one exception the library raises for bad input."""


class InputError(ValueError):
    """Something read from outside is not what was expected.

    The message is one line that names the file (and the row or key), what was
    expected, and what to do about it. The command line prints it and exits 2.
    """


def one_line(error: BaseException) -> str:
    """What another library's exception says, in one line of at most 300 characters; its type if nothing."""
    return " ".join(str(error).split())[:300] or type(error).__name__
