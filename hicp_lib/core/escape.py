"""Text from data (names of files, detectors, labels) on a page of Markdown or HTML."""

import re

_MARKUP = re.compile(r"[^\w .,;%/()=–—-]|(?<! )=|(?<![^\W_])_|_(?![^\W_])|^ ?-")
_SPACES = re.compile(r"\s+")


def escaped(text: object) -> str:
    """Text that is shown as it is, in Markdown (also in its tables, links and raw HTML) and in HTML.

    What means something there becomes a numeric character reference, in which both see nothing but the
    character. It is one line, since a line's end ends a table's row, and an empty line a block of HTML, with
    single spaces; what cannot be printed is replaced.

    Parameters
    ----------
    text : object
        A text, or what is turned into one.

    Examples
    --------
    >>> escaped("<svg onload=a()>\\n| b_c"), escaped(0.5)
    ('&#60;svg onload&#61;a()&#62; &#124; b_c', '0.5')
    """
    line = "".join(c if c.isprintable() else "\ufffd" for c in _SPACES.sub(" ", str(text)))
    return _MARKUP.sub(lambda found: "".join(f"&#{ord(c)};" for c in found[0]), line)
