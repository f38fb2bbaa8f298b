"""Where the spread of 3D keypoints over views comes from: one cause at a time, in simulated recordings.

Everything is lifted the same way. Starting from true pixels, depth without the sensor's errors and the true
camera pose, one of the three is replaced by what a robot has. What spreads already at the start is the
viewpoint's: another side of the limb is seen, or something in front of it.

Joint readings are wrong in two ways: by the same amount in every view, as with an encoder that is badly
calibrated, or anew in every view.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np
import pandas as pd

from hicp_lib.core.camera import transform
from hicp_lib.core.detections import Detections
from hicp_lib.core.errors import InputError
from hicp_lib.core.keypoints import FACE, INDEX, N_KEYPOINTS, NAMES
from hicp_lib.evaluation.space.stability import MIN_SCORE, PARTS, counted, position_array
from hicp_lib.lifting.table import lift_found, steps_of
from hicp_lib.recordings.recording import EXACT_DEPTH_DIR, JOINTS_FILE, Recording, read_joints, read_truth
from hicp_lib.robot.kinematics import HEAD_JOINTS, ICub, load_icub

JOINT_ERROR_RAD = float(np.deg2rad(0.5))
N_DRAWS = 20
VIEWPOINT, DEPTH, PIXEL = "nothing but the viewpoint", "depth sensor", "2D detection"
JOINT_OFFSET, JOINT_NOISE = "joint readings, constant error", "joint readings, new error per view"
TOGETHER = "2D detection, depth sensor and constant joint error"
CAUSES = (VIEWPOINT, DEPTH, PIXEL, JOINT_OFFSET, JOINT_NOISE, TOGETHER)

_TRUE = "true pixels"
_FACE = [NAMES[i] for i in FACE]
_CAMERA_POSITION = ["x_cam_m", "y_cam_m", "z_cam_m"]
_SAME_POSE_M = 1e-3
_COLUMNS = ["view", "detector", "part", "cause", "n", "spread_m", "p90_m", "bias_m"]


def spread_causes(
    views: Mapping[str, Recording],
    found: Mapping[tuple[str, str], Sequence[Detections]],
    points: pd.DataFrame,
    method: str = "robust",
    min_score: float = MIN_SCORE,
    joint_error_rad: float = JOINT_ERROR_RAD,
    seed: int = 0,
) -> pd.DataFrame:
    """Spread around the median position, and that position's bias, per view, detector, part and cause.

    All causes are judged on the same images and keypoints: those that were found with a score above
    `min_score`, and could be lifted whatever was replaced.

    Parameters
    ----------
    views : mapping of str to Recording
        By view.
    found : mapping of (str, str) to sequence of Detections
        Of each frame, by view and detector; the best person counts.
    points : DataFrame
        The same lifted by `method`, as `hicp_lib.study.relative.lift_views` does.
    method : str, optional
        Of lifting.
    min_score : float, optional
        Keypoints above it count.
    joint_error_rad : float, optional
        Standard deviation of the error of every joint of torso and neck.
    seed : int, optional
        Of the joints' errors.

    Returns
    -------
    DataFrame
        Columns `view, detector, part, cause` (one of `CAUSES`), `n` (images x keypoints), `spread_m` (median
        distance to the median position), `p90_m` (90th percentile) and `bias_m` (the median position's
        distance to the truth), each the mean over a part's keypoints, and over `N_DRAWS` draws of the joints'
        errors. No rows for views that are not simulated.

    Raises
    ------
    InputError
        If a recording's joints do not give its camera poses.
    """
    rows: list[tuple] = []
    for view, recording in views.items():
        truth = read_truth(recording)
        if truth is None or not is_simulated(recording):
            continue
        # The face decides on no other keypoint's depth.
        true = true_detections(truth[~truth["keypoint"].isin(_FACE)], len(recording))
        exact_paths = [recording.folder / EXACT_DEPTH_DIR / path.name for path in recording.depth_paths]
        exactly = replace(recording, depth_paths=exact_paths)
        exact = _lifted(exactly, {_TRUE: true} | found_in(found, view), method)
        known = {VIEWPOINT: counted(exact[_TRUE], 0.0)}
        known[DEPTH] = counted(_lifted(recording, {_TRUE: true}, method)[_TRUE], 0.0)
        of_view = points[(points["view"] == view) & (points["method"] == method)]
        measured = dict(list(of_view.groupby("detector")))
        poses = wrong_poses(recording, joint_error_rad, N_DRAWS, seed)
        for detector in found_in(found, view):
            lifted = dict(known)
            for cause, of_all in ((PIXEL, exact), (TOGETHER, measured)):
                lifted[cause] = counted(of_all.get(detector, points[:0]), min_score)
            rows += [(view, detector, *row) for row in _part_rows(recording, truth, lifted, poses)]
    return pd.DataFrame(rows, columns=_COLUMNS)


def is_simulated(recording: Recording) -> bool:
    """Whether a recording has truth, depth without errors and joints, as simulated ones have."""
    tables = (read_truth(recording), read_joints(recording))
    return (recording.folder / EXACT_DEPTH_DIR).is_dir() and all(table is not None for table in tables)


def true_detections(truth: pd.DataFrame, n_frames: int) -> list[Detections]:
    """The true pixels as if detected with full score, one person per frame; `truth` as from `read_truth`."""
    pixels = np.full((n_frames, N_KEYPOINTS, 2), np.nan)
    pixels[truth["frame"], truth["keypoint"].map(INDEX)] = truth[["u_px", "v_px"]]
    scores = np.isfinite(pixels).all(axis=-1).astype(float)
    return [Detections(pixels[k : k + 1], scores[k : k + 1], np.ones(1)) for k in range(n_frames)]


def wrong_poses(
    recording: Recording, joint_error_rad: float = JOINT_ERROR_RAD, n_draws: int = N_DRAWS, seed: int = 0
) -> dict[str, np.ndarray]:
    """Camera poses in the base frame as wrong joint readings give them.

    Parameters
    ----------
    recording : Recording
        With joints.
    joint_error_rad : float, optional
        Standard deviation of the error of every joint of torso and neck.
    n_draws : int, optional
        Number of draws of the errors.
    seed : int, optional
        Of the draws.

    Returns
    -------
    dict of str to array, shape (n_draws, n_frames, 4, 4)
        T_base_cam of `JOINT_OFFSET` and `JOINT_NOISE`.

    Raises
    ------
    InputError
        If the recording has no joints, or they do not give its poses.
    """
    joints = read_joints(recording)
    columns = [f"{name}_rad" for name in HEAD_JOINTS]
    if joints is None or not set(columns) <= set(joints):
        raise InputError(f"{recording.folder / JOINTS_FILE}: expected a table with {', '.join(columns)}")
    angles_rad = joints.sort_values("frame")[columns].to_numpy()
    icub = load_icub()
    mount = _mount(icub, angles_rad, recording)
    rng = np.random.default_rng(seed)
    errors_rad = {
        JOINT_OFFSET: rng.normal(0, joint_error_rad, (n_draws, 1, len(columns))),
        JOINT_NOISE: rng.normal(0, joint_error_rad, (n_draws, *angles_rad.shape)),
    }
    return {cause: icub.T_root_camera(angles_rad + error, mount) for cause, error in errors_rad.items()}


def _mount(icub: ICub, angles_rad: np.ndarray, recording: Recording) -> str:
    """The camera holder with which the joints give the recorded poses."""
    for mount in icub.T_head_camera:
        T_base_cam = icub.T_root_camera(angles_rad, mount)
        same_shape = T_base_cam.shape == recording.T_base_cam.shape
        if same_shape and np.abs(T_base_cam - recording.T_base_cam).max() < _SAME_POSE_M:
            return mount
    raise InputError(
        f"{recording.folder / JOINTS_FILE}: the joints do not give the camera poses with any of the holders "
        f"{', '.join(icub.T_head_camera)}; record both with the same robot model"
    )


def _lifted(
    recording: Recording, found: Mapping[str, Sequence[Detections]], method: str
) -> dict[str, pd.DataFrame]:
    """Table per detector."""
    return dict(list(lift_found(recording, found, {method: steps_of(method)}).groupby("detector")))


def _part_rows(
    recording: Recording,
    truth: pd.DataFrame,
    lifted: Mapping[str, pd.DataFrame],
    poses: dict[str, np.ndarray],
) -> Iterator[tuple]:
    """Part, cause, number, spread, 90th percentile and bias."""
    n, recorded = len(recording), recording.T_base_cam[None]
    poses = poses | {TOGETHER: poses[JOINT_OFFSET]}
    for part, keypoints in PARTS.items():
        true = position_array(truth, keypoints, n)
        in_camera = {
            cause: position_array(rows, keypoints, n, _CAMERA_POSITION) for cause, rows in lifted.items()
        }
        shared = np.all([np.isfinite(array).all(axis=-1) for array in in_camera.values()], axis=0)
        if not shared.any():
            continue
        for cause in CAUSES:
            at = transform(poses.get(cause, recorded), in_camera.get(cause, in_camera[VIEWPOINT]))
            yield part, cause, int(shared.sum()), *_spread(at, true, shared)


def _spread(positions_m: np.ndarray, true_m: np.ndarray, shared: np.ndarray) -> tuple[float, ...]:
    """Median and 90th percentile of the distance to the median, and its bias; mean over keypoints and draws.

    `positions_m` has the shape (draws, n_frames, n_keypoints, 3); `shared` says which count.
    """
    numbers = []
    for k in np.flatnonzero(shared.any(axis=0)):
        chosen_m, true = positions_m[:, shared[:, k], k], true_m[shared[:, k], k]
        distances = np.linalg.norm(chosen_m - np.median(chosen_m, axis=1, keepdims=True), axis=-1)
        bias = np.linalg.norm(np.median(chosen_m - true, axis=1), axis=-1)
        numbers.append([*np.percentile(distances, (50, 90), axis=1).mean(axis=1), bias.mean()])
    return tuple(np.mean(numbers, axis=0))


def found_in(
    found: Mapping[tuple[str, str], Sequence[Detections]], view: str
) -> dict[str, Sequence[Detections]]:
    """Detector -> detections of a view's frames."""
    return {detector: detections for (of_view, detector), detections in found.items() if of_view == view}
