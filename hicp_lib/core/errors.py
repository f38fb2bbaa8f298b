"""The one exception the library raises for bad input."""

from collections.abc import Iterable


class InputError(ValueError):
    """External input (a file, an option) is not as expected.

    The message is one line that names the file (and the row or key), what was
    expected, and what to do about it. The command line prints it and exits 2.
    """


def refuse_unknown(what: str, value: str, known: Iterable[str]) -> None:
    """Raise an error for a value that is not one of the known ones.

    Parameters
    ----------
    what : str
        What the value is, for the message.
    value : str
    known : iterable of str
        What it may be.

    Raises
    ------
    InputError

    Examples
    --------
    >>> refuse_unknown("format", "xml", ("coco", "mmpose"))
    Traceback (most recent call last):
    hicp_lib.core.errors.InputError: format 'xml' is not known; expected one of: coco, mmpose
    """
    if value not in known:
        raise InputError(f"{what} {value!r} is not known; expected one of: {', '.join(known)}")


def one_line(error: BaseException) -> str:
    """The message of another library's exception, in at most 300 characters; its type if it has none."""
    return " ".join(str(error).split())[:300] or type(error).__name__


def printable(text: str, kept: str = "") -> str:
    r"""Text with control and invisible characters replaced by their escapes.

    Examples
    --------
    >>> print(printable("a\x1b[2J\nb"))
    a\x1b[2J\nb
    """
    if text.isprintable():
        return text
    shown = (c if c.isprintable() or c in kept else c.encode("unicode_escape").decode() for c in text)
    return "".join(shown)
