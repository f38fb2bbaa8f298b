"""Text from data (names of files, detectors, labels) on a page of Markdown or HTML."""

import re

_MARKUP = re.compile(r"[^\w .,;%/()=–—-]|(?<! )=|(?<![^\W_])_|_(?![^\W_])|^ ?-")
_SPACES = re.compile(r"\s+")


def escaped(text: object) -> str:
    """Text that Markdown (including its tables, links and raw HTML) and HTML show literally.

    Characters with a meaning there become numeric character references. The result is one line with single
    spaces, since a line break would end a table row, and an empty line a block of HTML; unprintable
    characters are replaced.

    Parameters
    ----------
    text : object
        A text, or an object that is converted to one.

    Examples
    --------
    >>> escaped("<svg onload=a()>\\n| b_c"), escaped(0.5)
    ('&#60;svg onload&#61;a()&#62; &#124; b_c', '0.5')
    """
    line = "".join(c if c.isprintable() else "\ufffd" for c in _SPACES.sub(" ", str(text)))
    return _MARKUP.sub(lambda found: "".join(f"&#{ord(c)};" for c in found[0]), line)
