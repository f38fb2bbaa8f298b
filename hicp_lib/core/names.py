"""Checks of file names that come from external files."""

import re
from pathlib import PureWindowsPath

_UNWRITABLE = re.compile("[\x00-\x1f\x7f\ud800-\udfff]")  # control characters, lone surrogates


def is_inside(name: object) -> bool:
    """Whether something is a file name that cannot lead out of its folder, on any system.

    Examples
    --------
    >>> [is_inside(name) for name in ("rgb/a 1.png", "../a", "C:a", "a\\n", "", 300 * "a", 3)]
    [True, False, False, False, False, False, False]
    """
    if not isinstance(name, str) or _UNWRITABLE.search(name):
        return False
    path = PureWindowsPath(name)  # splits at both kinds of slash and knows drives
    is_short = max(map(len, path.parts), default=0) < 256  # as systems take it
    return bool(path.name) and not path.anchor and ".." not in path.parts and is_short
