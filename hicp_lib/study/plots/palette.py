"""Colours and markers: a fixed colour per detector, on every page."""

# Okabe and Ito's colour-blind-safe palette; a detector keeps its colour on every page.
DETECTOR_COLOURS: dict[str, str] = {
    "mediapipe": "#0072B2",
    "mediapipe-pose": "#56B4E9",
    "mediapipe-hands": "#CC79A7",
    "openpose-mobilenet": "#E69F00",
    "openpose": "#D55E00",
    "mmpose": "#009E73",
    "alphapose": "#7F5FA8",
    "detectron2": "#8C6D31",
    "combined": "#882255",
}
OTHER_COLOUR = "#595959"
TRUTH_COLOUR = "#111111"

# The two subsets of HiCP, and the two boxes of the paper's figure of how they are made.
SUBSET_COLOURS = {"basic": "#0072B2", "headless": "#D55E00"}
HEAD_COLOUR = "#D5272D"
BODY_COLOUR = "#1B9E4B"

# The paper's marker shapes for the OKS thresholds.
THRESHOLD_MARKERS = {".5": "s", ".75": "o", ".5:.95": "^"}


def detector_colour(name: str) -> str:
    """The colour of a detector, also of variants such as "mmpose-imported"; others take the neutral grey.

    All combinations ("combined:BODY+HANDS") share one.

    Examples
    --------
    >>> detector_colour("mmpose-imported") == detector_colour("mmpose")
    True
    """
    kind = name.partition(":")[0]
    known = [detector for detector in DETECTOR_COLOURS if f"{kind}-".startswith(f"{detector}-")]
    return DETECTOR_COLOURS[max(known, key=len)] if known else OTHER_COLOUR
