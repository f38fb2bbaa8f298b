"""What the 3D error of keypoints is made of: every source switched on alone, and off alone.

Simulated recordings know what is true. From there the sources are switched on, any of them together:

- *skin depth*: the lifting gives what it sees in a depth image without errors, at the true pixel: skin, cloth,
  or what hides the joint. Off, the vector from the joint to there is taken away again.
- *depth sensor*, *2D detection*: that depth image, that pixel is the measured one.
- *marker placement*, *registration*, *clock*: motion capture has the joint in the middle of two markers, in a
  frame that was found from clicks, at another instant.
- *joint offsets*, *camera mount*, *intrinsics*: the robot's encoders, the camera on its head and the camera's
  matrix are off by `Amounts`, the same for all frames of a person, anew for the next.

All are judged on the same keypoints: found with a score above a limit, in the image, and lifted whichever
pixels and depths are taken.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd

from hicp_lib.core.camera import Camera, deproject, project, transform
from hicp_lib.core.detections import Detections
from hicp_lib.core.errors import InputError
from hicp_lib.core.keypoints import FACE, INDEX, LEFT_HAND, N_KEYPOINTS, NAMES, RIGHT_HAND
from hicp_lib.core.rotations import rotation
from hicp_lib.evaluation.cases import labelled
from hicp_lib.evaluation.space.mocap_error import JOINTS, marker_means
from hicp_lib.evaluation.space.stability import MIN_SCORE, POSITION, counted, position_array
from hicp_lib.lifting.robust import METHODS
from hicp_lib.lifting.table import lift_found
from hicp_lib.recordings.qualisys import read_mocap
from hicp_lib.recordings.recording import (
    EXACT_DEPTH_DIR,
    JOINTS_FILE,
    PER_FRAME,
    Recording,
    read_joints,
    read_simulation,
    read_truth,
)
from hicp_lib.robot.kinematics import HEAD_JOINTS, load_icub

SKIN, SENSOR, PIXEL = "skin depth", "depth sensor", "2D detection"
MARKERS, REGISTRATION, CLOCK = "marker placement", "registration", "clock"
OFFSETS, MOUNT, INTRINSICS = "joint offsets", "camera mount", "intrinsics"
SOURCES = (SKIN, SENSOR, PIXEL, MARKERS, REGISTRATION, CLOCK, OFFSETS, MOUNT, INTRINSICS)
ALL = "everything"
AGAINST_MOCAP = "against motion capture"
"""Without joint offsets and mount: a registration through the same still camera takes them in."""
IN_BASE = "in the robot's frame"
TOTALS = {
    ALL: {*SOURCES},
    AGAINST_MOCAP: {*SOURCES} - {OFFSETS, MOUNT},
    IN_BASE: {*SOURCES} - {MARKERS, REGISTRATION, CLOCK},
}
STATES: dict[str, set[str]] = (
    TOTALS
    | {f"{source}, alone": {source} for source in SOURCES}
    | {f"without {source}": {*SOURCES} - {source} for source in SOURCES}
)
"""What is switched on, by the column that has the error then."""

FINGERS = tuple(NAMES[k] for hand in (LEFT_HAND, RIGHT_HAND) for k in hand[1:])
KEYPOINTS = (*JOINTS, *FINGERS)
_SIDES = {name: name.partition("_")[2] for name in JOINTS} | dict.fromkeys(FINGERS, "fingers")
_CAMERA_POSITION = ["x_cam_m", "y_cam_m", "z_cam_m"]
_SAME_POSE_M = 1e-3
_TRUE, _FOUND = "true", "found"


@dataclass(frozen=True)
class Amounts:
    """Standard deviations of what is off; one draw for all frames of a person, but for the jitter.

    Attributes
    ----------
    joint_offset_rad : float
        Of every joint of torso and neck.
    mount_rad, mount_m : float
        Of the camera on the head: turned about, and moved along, each axis.
    focal_share, centre_px : float
        Of the focal length, as a share of it, and of either coordinate of the image's centre.
    clock_s, jitter_s : float
        Of the offset between the clocks, and of each frame's stamp.
    """

    joint_offset_rad: float
    mount_rad: float
    mount_m: float
    focal_share: float
    centre_px: float
    clock_s: float
    jitter_s: float


def is_simulated(recording: Recording) -> bool:
    """Whether a recording has truth, depth without errors and joints, as simulated ones have."""
    tables = (read_truth(recording), read_joints(recording))
    return (recording.folder / EXACT_DEPTH_DIR).is_dir() and all(table is not None for table in tables)


def keypoint_errors(
    recordings: Mapping[tuple[str, int], Recording],
    found: Mapping[tuple[str, int], Sequence[Detections]],
    registered: Mapping[tuple[str, int], np.ndarray],
    amounts: Amounts,
    every: int = 1,
    min_score: float = MIN_SCORE,
    seed: int = 0,
) -> pd.DataFrame:
    """Errors of every keypoint with each set of sources, frame by frame.

    Parameters
    ----------
    recordings : mapping of (str, int) to Recording
        By scenario and subject.
    found : mapping of (str, int) to sequence of Detections
        Of each frame; the best person counts.
    registered : mapping of (str, int) to array, shape (4, 4)
        T_base_mocap as found from clicks, of recordings with motion capture.
    amounts : Amounts
        What is off, and how much.
    every : int, optional
        Every which frame counts.
    min_score : float, optional
        Keypoints above it count.
    seed : int, optional
        Of the amounts' draws.

    Returns
    -------
    DataFrame
        A row per keypoint that counts: columns `scenario, subject, method, part, keypoint, frame`,
        `distance_m` (from the camera), `turned_rad` (of the person away from it), `hidden` (by something in
        front of it), and the error in metres in the column of each of `STATES`. No rows for recordings that are
        not simulated.

    Raises
    ------
    InputError
        If a recording's joints do not give its camera poses.
    """
    tables = [
        labelled(
            _errors(recording, found[case], registered.get(case), amounts, every, min_score, [seed, case[1]]),
            scenario=case[0],
            subject=case[1],
        )
        for case, recording in recordings.items()
        if is_simulated(recording)
    ]
    return pd.concat(tables, ignore_index=True) if tables else pd.DataFrame()


def _errors(
    recording: Recording,
    found: Sequence[Detections],
    T_base_mocap: np.ndarray | None,
    amounts: Amounts,
    every: int,
    min_score: float,
    seed: list[int],
) -> pd.DataFrame:
    rng, n, truth = np.random.default_rng(seed), len(recording), read_truth(recording)
    true_m, visible = (position_array(truth, KEYPOINTS, n, of) for of in (POSITION, ["visible"]))
    shifts_m = _reference_shifts(recording, true_m, T_base_mocap, amounts, rng)
    wrong = _wrong_camera(recording, amounts, rng)
    frames, true = slice(None, None, every), true_detections(truth, n)
    some = replace(recording, **{name: getattr(recording, name)[frames] for name in PER_FRAME})
    of_frames = [array[frames] for array in (true_m, *shifts_m.values())]
    true_m, shifts_m = of_frames[0], dict(zip(shifts_m, of_frames[1:], strict=True))
    poses = {which: T[frames] for which, T in wrong.poses.items()}
    seen_m = _lifted(some, {_TRUE: true[frames], _FOUND: found[frames]}, min_score)
    true_cam_m = transform(np.linalg.inv(some.T_base_cam), true_m)
    counts = np.all([np.isfinite(array).all(axis=-1) for array in (*seen_m.values(), *of_frames)], axis=0)
    counts &= visible[frames, :, 0] > 0
    at, which = np.nonzero(counts)
    columns = {"keypoint": np.array(KEYPOINTS)[which], "frame": at * every}
    columns["distance_m"] = np.linalg.norm(true_cam_m, axis=-1)[counts]
    columns["turned_rad"] = _turned_rad(true_m, some.T_base_cam)[at]
    columns["hidden"] = visible[frames, :, 0][counts] == 1
    tables = []
    for method in METHODS:
        skin_m = seen_m[method, _TRUE, False] - true_cam_m
        errors_m = {}
        for state, sources in STATES.items():
            points_m = seen_m[method, _FOUND if PIXEL in sources else _TRUE, SENSOR in sources]
            points_m = points_m if SKIN in sources else points_m - skin_m
            if INTRINSICS in sources:
                pixels_px = project(recording.intrinsics, points_m)
                points_m = deproject(wrong.intrinsics, pixels_px, points_m[..., 2])
            at_m = transform(poses[OFFSETS in sources, MOUNT in sources], points_m)
            at_m = at_m - true_m - sum(shift_m for name, shift_m in shifts_m.items() if name in sources)
            errors_m[state] = np.linalg.norm(at_m, axis=-1)[counts]
        tables.append(pd.DataFrame({"method": method, **columns, **errors_m}))
    table = pd.concat(tables, ignore_index=True)
    return labelled(table, part=table["keypoint"].map(_SIDES))


def true_detections(truth: pd.DataFrame, n_frames: int) -> list[Detections]:
    """The true pixels as if detected with full score, one person per frame; `truth` as from `read_truth`.

    Without the face: its keypoints decide on no other's depth.
    """
    truth = truth[~truth["keypoint"].isin([NAMES[k] for k in FACE])]
    pixels = np.full((n_frames, N_KEYPOINTS, 2), np.nan)
    pixels[truth["frame"], truth["keypoint"].map(INDEX)] = truth[["u_px", "v_px"]]
    scores = np.isfinite(pixels).all(axis=-1).astype(float)
    return [Detections(pixels[k : k + 1], scores[k : k + 1], np.ones(1)) for k in range(n_frames)]


@dataclass(frozen=True)
class _WrongCamera:
    """What is thought of a camera: its intrinsics, and T_base_cam (n, 4, 4) by which of joints and mount are off."""

    intrinsics: Camera
    poses: dict[tuple[bool, bool], np.ndarray]


def _wrong_camera(recording: Recording, amounts: Amounts, rng: np.random.Generator) -> _WrongCamera:
    joints, columns = read_joints(recording), [f"{name}_rad" for name in HEAD_JOINTS]
    if joints is None or not set(columns) <= set(joints):
        raise InputError(f"{recording.folder / JOINTS_FILE}: expected a table with {', '.join(columns)}")
    angles_rad = joints.sort_values("frame")[columns].to_numpy()
    mount = _mount(recording, angles_rad)
    off_rad = angles_rad + rng.normal(0, amounts.joint_offset_rad, angles_rad.shape[1])
    poses = {False: recording.T_base_cam, True: load_icub().T_root_camera(off_rad, mount)}
    T_cam_thought = np.eye(4)
    T_cam_thought[:3, :3] = rotation(rng.normal(0, amounts.mount_rad, 3))
    T_cam_thought[:3, 3] = rng.normal(0, amounts.mount_m, 3)
    moved = {False: np.eye(4), True: T_cam_thought}
    camera, (share, u_px, v_px) = recording.intrinsics, rng.normal(0, 1, 3)
    factor, u_px, v_px = 1 + amounts.focal_share * share, amounts.centre_px * u_px, amounts.centre_px * v_px
    thought = replace(
        camera,
        fx_px=camera.fx_px * factor,
        fy_px=camera.fy_px * factor,
        cx_px=camera.cx_px + u_px,
        cy_px=camera.cy_px + v_px,
    )
    return _WrongCamera(thought, {(a, b): poses[a] @ moved[b] for a in poses for b in moved})


def _mount(recording: Recording, angles_rad: np.ndarray) -> str:
    """The camera holder with which the joints give the recorded poses."""
    icub = load_icub()
    for mount in icub.T_head_camera:
        T_base_cam = icub.T_root_camera(angles_rad, mount)
        same_shape = T_base_cam.shape == recording.T_base_cam.shape
        if same_shape and np.abs(T_base_cam - recording.T_base_cam).max() < _SAME_POSE_M:
            return mount
    raise InputError(
        f"{recording.folder / JOINTS_FILE}: the joints do not give the camera poses with any of the holders "
        f"{', '.join(icub.T_head_camera)}; record both with the same robot model"
    )


def _reference_shifts(
    recording: Recording,
    true_m: np.ndarray,
    T_base_mocap: np.ndarray | None,
    amounts: Amounts,
    rng: np.random.Generator,
) -> dict[str, np.ndarray]:
    """By how much motion capture has the keypoints beside the true ones (n, k, 3), by source; none without it."""
    if recording.mocap_path is None or T_base_mocap is None:
        return {}
    simulation, mocap = read_simulation(recording), read_mocap(recording.mocap_path)
    exact = np.array(simulation["T_base_mocap"])
    means = marker_means(mocap, recording.times_s - simulation["mocap_offset_s"], exact)
    markers_m = np.zeros_like(true_m)  # fingers have none
    markers_m[:, : len(JOINTS)] = position_array(means, JOINTS, len(recording)) - true_m[:, : len(JOINTS)]
    late_s = rng.normal(0, amounts.clock_s) + rng.normal(0, amounts.jitter_s, len(recording))
    speed_m_s = np.gradient(true_m, recording.times_s, axis=0)
    return {
        MARKERS: markers_m,
        REGISTRATION: transform(T_base_mocap @ np.linalg.inv(exact), true_m) - true_m,
        CLOCK: speed_m_s * late_s[:, None, None],
    }


def _lifted(
    recording: Recording, found: Mapping[str, Sequence[Detections]], min_score: float
) -> dict[tuple[str, str, bool], np.ndarray]:
    """Places in the camera's frame (n, k, 3) by method, pixels, and whether the depth is the sensor's."""
    exact_paths = [recording.folder / EXACT_DEPTH_DIR / path.name for path in recording.depth_paths]
    lifted = {}
    for is_measured, depth in ((True, recording), (False, replace(recording, depth_paths=exact_paths))):
        table = lift_found(depth, found)
        limits = table["detector"].map({_TRUE: 0.0, _FOUND: min_score})
        table = counted(table[table["score"] > limits], 0.0, _CAMERA_POSITION)
        rows = dict(list(table.groupby(["method", "detector"])))
        for method, pixels in ((method, pixels) for method in METHODS for pixels in found):
            of = rows.get((method, pixels), table[:0])
            lifted[method, pixels, is_measured] = position_array(
                of, KEYPOINTS, len(recording), _CAMERA_POSITION
            )
    return lifted


def _turned_rad(true_m: np.ndarray, T_base_cam: np.ndarray) -> np.ndarray:
    """How far the shoulders are turned away from the camera about the vertical, (n,)."""
    left_m, right_m = (true_m[:, KEYPOINTS.index(f"{side}_shoulder"), :2] for side in ("left", "right"))
    across_m, to_camera_m = right_m - left_m, T_base_cam[:, :2, 3] - (left_m + right_m) / 2
    front_m = np.stack([-across_m[:, 1], across_m[:, 0]], axis=1)
    cosine = (front_m * to_camera_m).sum(axis=1)
    return np.arccos(cosine / np.linalg.norm(front_m, axis=1) / np.linalg.norm(to_camera_m, axis=1))
