"""Lift the keypoints of all people in a recording, as one tidy table."""

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd

from hicp_lib.core.camera import transform
from hicp_lib.core.detections import Detections
from hicp_lib.core.errors import InputError, refuse_unknown
from hicp_lib.core.keypoints import N_KEYPOINTS, NAMES
from hicp_lib.core.progress import with_bar
from hicp_lib.lifting.paper import BODY_RADIUS_M, REASONS, lift
from hicp_lib.lifting.robust import METHODS, lift_robust
from hicp_lib.recordings.recording import Recording, read_depth_m

_NAMES = {"keypoint": pd.Series(NAMES), "reason": pd.Series(REASONS)}
_COORDINATES = ("x_m", "y_m", "z_m", "x_cam_m", "y_cam_m", "z_cam_m")


def lift_recording(
    recording: Recording, detections: Sequence[Detections], method: str = "robust"
) -> pd.DataFrame:
    """Lift the keypoints of all people in every frame.

    Parameters
    ----------
    recording : Recording
    detections : sequence of Detections
        Of each frame's colour image, in the recording's order.
    method : str, optional
        "robust" or "paper".

    Returns
    -------
    pd.DataFrame
        One row per frame x person x keypoint detected, columns frame (row of the recording), t_s, person (0
        has the highest score), keypoint (Halpe name), u_px, v_px, score, x_m, y_m, z_m (robot's base frame),
        x_cam_m, y_cam_m, z_cam_m (camera frame), sigma_m (of the depth; NaN by the paper's method), reason
        (one of `hicp_lib.lifting.paper.REASONS`); coordinates are NaN unless it is "lifted" or "guessed".

    Raises
    ------
    InputError
        For an unknown method, detections of another number of frames, or a depth image that cannot be read.
    """
    refuse_unknown("method of lifting", method, METHODS)
    n_steps = {method: METHODS[method]}
    return lift_found(recording, {"": detections}, n_steps).drop(columns=["detector", "method"])


def lift_found(
    recording: Recording, found: Mapping[str, Sequence[Detections]], n_steps: Mapping[str, int] = METHODS
) -> pd.DataFrame:
    """Lift the results of several detectors by several methods; every depth image is read once.

    Parameters
    ----------
    recording : Recording
    found : mapping of str to sequence of Detections
        By detector, detections of each frame, as of `lift_recording`.
    n_steps : mapping of str to int, optional
        By method, how many of `hicp_lib.lifting.robust.STEPS` it takes.

    Returns
    -------
    pd.DataFrame
        Columns detector, method and those of `lift_recording`; method by method of each detector.

    Raises
    ------
    InputError
        For detections of another number of frames, or a depth image that cannot be read.
    """
    for detections in found.values():
        if len(detections) != len(recording):
            counts = f"{len(recording)} frames, but detections of {len(detections)} images"
            raise InputError(f"{recording.folder}: {counts}; detect people in the frames of this recording")
    frames: dict[tuple[str, str], list] = {(detector, method): [] for detector in found for method in n_steps}
    for k in with_bar(range(len(recording)), "lifting", "frame"):
        depth_m = read_depth_m(recording, k)
        for (detector, method), of_one in frames.items():
            of_one.append(_lift_frame(recording, k, depth_m, found[detector][k], n_steps[method]))
    tables = {key: _table(of_one) for key, of_one in frames.items()}
    return pd.concat(tables, names=["detector", "method"]).droplevel(2).reset_index()


def lift_pixels(
    recording: Recording, pixels: pd.DataFrame, radii_m: Sequence[float] = (BODY_RADIUS_M,)
) -> np.ndarray:
    """Lift pixels of a recording's images by the paper's method.

    Parameters
    ----------
    recording : Recording
    pixels : pd.DataFrame
        Columns `frame, u_px, v_px`, n rows.
    radii_m : sequence of float, optional
        Half the side of the neighbourhood from which the depth is taken; every depth image is read once.

    Returns
    -------
    array, shape (n_radii, n, 3)
        In the robot's base frame; NaN where not lifted.
    """
    pixels, seen_m = pixels.reset_index(drop=True), np.full((len(radii_m), len(pixels), 3), np.nan)
    for frame, rows in pixels.groupby("frame"):
        depth_m = read_depth_m(recording, frame)
        keypoints_px = np.full((len(rows), N_KEYPOINTS, 2), np.nan)
        keypoints_px[:, 0] = rows[["u_px", "v_px"]]
        for of_radius_m, radius_m in zip(seen_m, radii_m, strict=True):
            lifted = lift(keypoints_px, depth_m, recording.intrinsics, radius_m)
            of_radius_m[rows.index] = transform(recording.T_base_cam[frame], lifted.points_m[:, 0])
    return seen_m


def _lift_frame(
    recording: Recording, k: int, depth_m: np.ndarray, found: Detections, n_steps: int
) -> dict[str, np.ndarray]:
    """A frame's columns, keypoints and reasons as numbers."""
    best_first = np.argsort(-found.person_scores, kind="stable")
    keypoints_px, scores = found.keypoints_px[best_first], found.scores[best_first]
    person, keypoint = np.nonzero(np.isfinite(keypoints_px).all(axis=2))
    u_px, v_px = keypoints_px[person, keypoint].T
    lifted = lift_robust(keypoints_px, depth_m, recording.intrinsics, n_steps)
    seen_m = lifted.points_m[person, keypoint]
    base_m = transform(recording.T_base_cam[k], seen_m)
    return {
        "frame": np.full(len(person), k), "t_s": np.full(len(person), recording.times_s[k]), "person": person,
        "keypoint": keypoint, "u_px": u_px, "v_px": v_px, "score": scores[person, keypoint],
        **dict(zip(_COORDINATES, [*base_m.T, *seen_m.T], strict=True)),
        "sigma_m": lifted.sigma_m[person, keypoint], "reason": lifted.reason[person, keypoint],
    }  # fmt: skip


def _table(frames: Sequence[dict[str, np.ndarray]]) -> pd.DataFrame:
    """The columns of all frames, keypoints and reasons by name."""
    columns = {name: np.concatenate([frame[name] for frame in frames]) for name in frames[0]}
    for name, texts in _NAMES.items():
        columns[name] = texts.array.take(columns[name])
    return pd.DataFrame(columns)
