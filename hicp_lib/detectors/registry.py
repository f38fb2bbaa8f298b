"""The detectors by name, for the command line and the notebooks (`data/detector_facts.json`)."""

from dataclasses import dataclass
from importlib import import_module
from inspect import Parameter, signature
from typing import Any, get_args, get_type_hints

from hicp_lib.core.datafiles import DATA_DIR
from hicp_lib.core.detections import Detector
from hicp_lib.core.errors import InputError, refuse_unknown
from hicp_lib.core.files import read_json
from hicp_lib.detectors.weights.user import user_options


@dataclass(frozen=True)
class Facts:
    """Properties of a detector, as in the paper's Table II.

    Attributes
    ----------
    paradigm : {"top-down", "bottom-up", "one-stage"}
        Whether people are found first and then their keypoints, or keypoints first, or both at once.
    keypoints : str
        How many, and of what.
    training_data : str
    tracking : str
        How its authors' program tracks people from image to image; here each image is processed alone.
    input : str
        Size of the network's input, width x height.
    n_parameters : int or None
        Of all its networks; None if it depends on the user's weights.
    n_operations : int or None
        Multiply-add operations of one run of each.
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
    """An available detector.

    Attributes
    ----------
    name : str
        The name that users type.
    label : str
        Its name in figures and tables.
    groups : tuple of str
        Keypoint groups on which it can be evaluated, keys of `hicp_lib.core.keypoints.GROUPS`.
    module, class_name : str
        Where it is; imported on demand, MediaPipe alone takes a second.
    needs_model : bool
        Whether it needs a weight file from the user, option `model`.
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


# Full module names: the dependencies of cached results are found by them (`hicp_lib.core.cache`).
_CLASSES = {
    "hicp_lib.detectors.mediapipe.tasks": "MediaPipePose MediaPipeHands MediaPipe",
    "hicp_lib.detectors.movenet.networks": "MoveNetThunder MoveNetLightning MoveNetMultiPose",
    "hicp_lib.detectors.posenet.detector": "PoseNetMobileNet",
    "hicp_lib.detectors.closerange.detector": "CloseRange",
    "hicp_lib.detectors.openpose.networks": "OpenPoseMobileNet OpenPose",
    "hicp_lib.detectors.onnx.mmpose": "MMPose",
    "hicp_lib.detectors.onnx.alphapose": "AlphaPose",
    "hicp_lib.detectors.onnx.keypoint_rcnn": "KeypointRcnn",
    "hicp_lib.detectors.onnx.one_stage": "OneStage",
}
_MODULE_OF = {name: module for module, names in _CLASSES.items() for name in names.split()}
COMBINED = "combined:"
# In a combination the body confirms the hands, so the hand model's threshold is lower, and other people's
# hands in a square must not use up the number.
_HANDS_WITHIN: dict[str, dict[str, Any]] = {"mediapipe-hands": {"num_hands": 4, "min_score": 0.2}}
# Allowed range of numbers, by the ending of the option's name; all others are counts.
_BOUNDS = {"score": (0, 1), "overlap": (0, 1), "hz": (0, 1e4), "threads": (1, 256), "padding": (0.1, 10)}
_BOUNDS |= {"scale": (0.001, 1000), "": (1, 10_000)}
# Parameters and operations are those of the convolutions and fully connected layers in the files.
DETECTORS: dict[str, Entry] = {
    name: Entry(name, row.pop("label"), tuple(row.pop("groups")), _MODULE_OF[row["class_name"]],
                facts=Facts(**row.pop("facts")), **row)
    for name, row in read_json(DATA_DIR / "detector_facts.json").items()
}  # fmt: skip


def default_detector_names() -> list[str]:
    """Names of the detectors that need no weight file from the user."""
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
    """The command that sets a detector's weights from then on, also in notebooks."""
    return f"hicp models use --detector {name} --model FILE.onnx"


def make_detector(name: str, /, **options) -> Detector:
    """A detector ready to run.

    A detector that needs a model and gets none uses the registered one (`hicp_lib.detectors.weights.user`).
    `combined:BODY+HANDS` combines two detectors (see `hicp_lib.detectors.combined.detector`): it takes its
    own options, those of the hand detector prefixed by `hands_`, and passes all others to the body detector.

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
    hicp_lib.core.errors.InputError: detector 'openpose-mobilenet': option 'height' is not known; expected ...
    """
    if name.startswith(COMBINED):
        return _make_combined(name, options)
    refuse_unknown("detector", name, [*DETECTORS, f"{COMBINED}BODY+HANDS"])
    entry = DETECTORS[name]
    if entry.needs_model and not options.get("model"):
        options = user_options(name) | options
        if not options.get("model"):
            how = f"name it once with: {command_to_use(name)}; or give it with: {command_to_run(name)}"
            raise InputError(f"detector {name!r} needs a weight file of your own; {how}")
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
    if for_hands.get("tracking_hz") and own.get("looks") != "image":
        wrong = "hands are searched for in parts of an image one after the other, which are no video"
        raise InputError(f"detector {name!r}: {wrong}; leave out hands_tracking_hz, or give looks 'image'")
    for_body = {key: options[key] for key in options if key not in own and not key.startswith("hands_")}
    return combined_class(make_detector(body, **for_body), make_detector(hands, **for_hands), **own)


def _option_types(detector_class: type) -> dict[str, tuple[type, ...]]:
    """The types that each option may have."""
    hints: dict[str, Any] = {}
    for name, parameter in signature(detector_class, eval_str=True).parameters.items():
        is_shared = parameter.kind is Parameter.VAR_KEYWORD  # with other detectors
        hints |= (
            get_type_hints(*get_args(parameter.annotation)) if is_shared else {name: parameter.annotation}
        )
    kinds = {name: get_args(kind) or (kind,) for name, kind in hints.items()}
    return {name: (*kind, int) if float in kind else kind for name, kind in kinds.items()}


def _check_options(name: str, detector_class: type, options: dict[str, Any]) -> None:
    kinds = _option_types(detector_class)
    for option, value in options.items():
        refuse_unknown(f"detector {name!r}: option", option, kinds)
        wrong = f"detector {name!r}: option {option!r} is {value!r}"
        if value == "":
            raise InputError(f"detector {name!r}: option {option!r} is empty; give a value, or leave it out")
        if not isinstance(value, kinds[option]) or (isinstance(value, bool) and bool not in kinds[option]):
            raise InputError(f"{wrong}; expected {' or '.join(kind.__name__ for kind in kinds[option])}")
        least, most = next(of for end, of in _BOUNDS.items() if option.endswith(end))
        numbers: list[Any] = value if isinstance(value, list) else [value]
        if not all(least <= one <= most for one in numbers if type(one) in (int, float)):  # NaN is outside
            raise InputError(f"{wrong}; expected {least:g} to {most:g}")


def describe(detector: Detector) -> list[tuple[str, str, str]]:
    """A detector's assumptions: rows of property, value, and how the value was determined."""
    if hasattr(detector, "describe"):
        return detector.describe()
    return [(key, str(value), "") for key, value in detector.settings.items()]
