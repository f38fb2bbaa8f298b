"""Colours and markers: a fixed pair per detector, on every page."""

import tomllib
from typing import Any

from hicp_lib.core.datafiles import DATA_DIR
from hicp_lib.core.files import read_json

Marker = str | tuple[int, ...]  # in Matplotlib's notation
TRUTH_COLOUR = "#111111"
PERFECT = "perfect detector"  # what finds the true keypoints, where they are known

# Each detector's colour and marker, the same on every page. Those of the default study stay apart for readers
# who are blind to red or green, too; the others do so by their markers.
DETECTOR_STYLES: dict[str, tuple[str, Marker]] = {
    name: (colour, tuple(marker) if isinstance(marker, list) else marker)
    for name, (colour, marker) in read_json(DATA_DIR / "detector_styles.json").items()
} | {PERFECT: (TRUTH_COLOUR, "x")}
OTHER_COLOUR, _OTHER_MARKER = "#595959", "."

STYLES: dict[str, dict[str, Any]] = tomllib.loads((DATA_DIR / "figure_styles.toml").read_text("utf-8"))
"""How all else looks, by what it is and its name: options of Matplotlib."""

# The two boxes of the paper's figure of how the subsets are made.
HEAD_COLOUR = "#D5272D"
BODY_COLOUR = "#1B9E4B"


def detector_colour(name: str) -> str:
    """The colour of a detector, also of variants such as "mmpose-imported"; others take the neutral grey.

    Combinations ("combined:BODY+HANDS") share one, but for those on the bodies of MoveNet Thunder.

    Examples
    --------
    >>> detector_colour("mmpose-imported") == detector_colour("mmpose")
    True
    """
    return _style(name)[0]


def detector_marker(name: str) -> Marker:
    """The marker of a detector in Matplotlib's notation; found as `detector_colour` finds the colour.

    Examples
    --------
    >>> detector_marker("movenet-thunder"), detector_marker("combined:movenet-thunder+mediapipe-hands")
    ('s', 'P')
    """
    return _style(name)[1]


def _style(name: str) -> tuple[str, Marker]:
    alike = [key for key in DETECTOR_STYLES if name.startswith(key)]
    known = [key for key in alike if name[len(key) : len(key) + 1] in "-:+"]
    return DETECTOR_STYLES[max(known, key=len)] if known else (OTHER_COLOUR, _OTHER_MARKER)
