"""Everyone's keypoints of a recording in space, as one tidy table."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import pandas as pd

from hicp_lib.detectors.base import Detections
from hicp_lib.errors import InputError
from hicp_lib.keypoints import NAMES
from hicp_lib.rgbd.camera import Intrinsics, transform
from hicp_lib.rgbd.lifting import REASONS, Lifted
from hicp_lib.rgbd.recording import Recording, read_depth_m
from hicp_lib.rgbd.robust_lifting import METHODS

Lifting = Callable[[np.ndarray, np.ndarray, Intrinsics], Lifted]
"""Keypoints (n_people, 136, 2), depth (height, width) and intrinsics to points, as `lifting.lift`."""


def lift_recording(
    recording: Recording, detections: Sequence[Detections], method: str | Lifting = "robust"
) -> pd.DataFrame:
    """Lift the keypoints of everyone in every frame.

    Parameters
    ----------
    detections : of each frame's colour image, in the recording's order
    method : "robust", "paper" (see `robust_lifting.METHODS`), or a function like those

    Returns
    -------
    DataFrame, one row per frame x person x keypoint detected, columns
        frame (row of the recording), t_s, person (0 has the best score), keypoint (Halpe name), u_px, v_px,
        score, x_m, y_m, z_m (robot's base frame), x_cam_m, y_cam_m, z_cam_m (camera frame), reason (one of
        `lifting.REASONS`); coordinates are NaN where the reason is not "lifted"

    Raises
    ------
    InputError
        For an unknown method, detections of another number of frames, or a depth image that cannot be read.
    """
    lifting = lifting_method(method) if isinstance(method, str) else method
    if len(detections) != len(recording):
        raise InputError(
            f"{recording.folder}: {len(recording)} frames, but detections of {len(detections)} images; "
            "detect people in the frames of this recording"
        )
    frames = [_lift_frame(recording, k, found, lifting) for k, found in enumerate(detections)]
    table = {name: np.concatenate([frame[name] for frame in frames]) for name in frames[0]}
    table["keypoint"], table["reason"] = (
        np.array(NAMES)[table["keypoint"]],
        np.array(REASONS)[table["reason"]],
    )
    return pd.DataFrame(table)


def lifting_method(name: str) -> Lifting:
    """A way of lifting by its name.

    Raises
    ------
    InputError
        For an unknown name.
    """
    if name not in METHODS:
        raise InputError(f"no method {name!r} of lifting; choose one of {', '.join(METHODS)}")
    return METHODS[name]


def _lift_frame(recording: Recording, k: int, found: Detections, lifting: Lifting) -> dict[str, np.ndarray]:
    """Columns of one frame; keypoints and reasons as numbers."""
    best_first = np.argsort(-found.person_scores, kind="stable")
    keypoints_px, scores = found.keypoints_px[best_first], found.scores[best_first]
    person, keypoint = np.nonzero(np.isfinite(keypoints_px).all(axis=2))
    lifted = lifting(keypoints_px, read_depth_m(recording, k), recording.intrinsics)
    seen_m = lifted.points_m[person, keypoint]
    base_m = transform(recording.T_base_cam[k], seen_m)
    u_px, v_px = keypoints_px[person, keypoint].T
    columns = {"frame": np.full(len(person), k), "t_s": np.full(len(person), recording.times_s[k])}
    columns |= {"person": person, "keypoint": keypoint, "u_px": u_px, "v_px": v_px}
    columns["score"] = scores[person, keypoint]
    columns |= dict(zip(("x_m", "y_m", "z_m"), base_m.T, strict=True))
    columns |= dict(zip(("x_cam_m", "y_cam_m", "z_cam_m"), seen_m.T, strict=True))
    return columns | {"reason": lifted.reason[person, keypoint]}
