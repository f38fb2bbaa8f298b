"""Sources of error of keypoints in space, which can be switched on: camera, robot, motion capture.

Calibration errors are drawn once per person, as if each had a robot of their own, and are constant over their
frames.
"""

from dataclasses import dataclass, replace

import numpy as np
import pandas as pd

from hicp_lib.core.camera import Camera, transform
from hicp_lib.core.detections import Detections
from hicp_lib.core.errors import InputError
from hicp_lib.core.extras import needs
from hicp_lib.core.keypoints import FACE, N_KEYPOINTS, NAMES
from hicp_lib.core.rotations import rotation
from hicp_lib.evaluation.space.mocap_error import JOINTS, marker_means
from hicp_lib.evaluation.space.stability import position_array
from hicp_lib.recordings import recording as rec
from hicp_lib.recordings.qualisys import read_mocap
from hicp_lib.robot.kinematics import HEAD_JOINTS, load_icub

with needs("analysis"):
    from scipy.interpolate import CubicSpline

SKIN, SENSOR, PIXEL = "skin depth", "depth sensor", "2D detection"
MARKERS, REGISTRATION, CLOCK = "marker placement", "registration", "clock"
OFFSETS, MOUNT, INTRINSICS = "joint offsets", "camera mount", "intrinsics"
SOURCES = (SKIN, SENSOR, PIXEL, MARKERS, REGISTRATION, CLOCK, OFFSETS, MOUNT, INTRINSICS)

_SAME_POSE_M = 1e-3
WITHOUT_FACE = np.setdiff1d(np.arange(N_KEYPOINTS), FACE)


@dataclass(frozen=True)
class Amounts:
    """Standard deviations of errors, drawn once per person except for the jitter.

    Attributes
    ----------
    joint_offset_rad : float
        Of every joint of torso and neck.
    mount_rad, mount_m : float
        Of the camera on the head: rotation about, and translation along, each axis.
    focal_share, centre_px : float
        Of the focal length, relative to it, and of either coordinate of the principal point.
    clock_s, jitter_s : float
        Of the offset between the clocks, and of each frame's timestamp.
    """

    joint_offset_rad: float
    mount_rad: float
    mount_m: float
    focal_share: float
    centre_px: float
    clock_s: float
    jitter_s: float


def true_detections(
    truth: pd.DataFrame, n_frames: int, keypoints: np.ndarray = WITHOUT_FACE
) -> list[Detections]:
    """The true pixels as detections, including occluded ones, one person per frame.

    Parameters
    ----------
    truth : DataFrame
        As from `read_truth`.
    n_frames : int
        Number of images.
    keypoints : array of int, optional
        Indices of the detected ones. Those of the face do not influence the depth of others.

    Returns
    -------
    list of Detections
        With scores of 1.
    """
    keypoints_px = np.full((n_frames, 1, N_KEYPOINTS, 2), np.nan)
    names = [NAMES[k] for k in keypoints]
    keypoints_px[:, 0, keypoints] = position_array(truth, names, n_frames, ["u_px", "v_px"])
    scores = np.isfinite(keypoints_px).all(axis=-1).astype(float)
    return [Detections(*person, np.ones(1)) for person in zip(keypoints_px, scores, strict=True)]


def wrong_intrinsics(camera: Camera, amounts: Amounts, rng: np.random.Generator) -> Camera:
    """The camera with another focal length and principal point.

    Parameters
    ----------
    camera : Camera
        The true one.
    amounts : Amounts
        What is off, and how much.
    rng : numpy.random.Generator
        Of the draws.

    Returns
    -------
    Camera
        The assumed one.
    """
    factor = 1 + rng.normal(0, amounts.focal_share)
    cx_px, cy_px = rng.normal((camera.cx_px, camera.cy_px), amounts.centre_px)
    fx_px, fy_px = factor * camera.fx_px, factor * camera.fy_px
    return replace(camera, fx_px=fx_px, fy_px=fy_px, cx_px=cx_px, cy_px=cy_px)


def wrong_poses(
    recording: rec.Recording, amounts: Amounts, rng: np.random.Generator
) -> dict[tuple[bool, bool], np.ndarray]:
    """Camera poses in the base frame with errors of joint angles and of the camera mount.

    Parameters
    ----------
    recording : rec.Recording
        With joints.
    amounts : Amounts
        What is off, and how much.
    rng : numpy.random.Generator
        Of the draws.

    Returns
    -------
    dict of (bool, bool) to array, shape (n_frames, 4, 4)
        T_base_cam, by whether joints and mount have errors.

    Raises
    ------
    InputError
        If the recording's joints do not give its poses.
    """
    columns, icub = [f"{name}_rad" for name in HEAD_JOINTS], load_icub()
    joints, recorded = rec.read_joints(recording), recording.T_base_cam
    joints = pd.DataFrame(columns=["frame"]) if joints is None else joints
    angles_rad = joints.sort_values("frame").reindex(columns=columns).to_numpy(float)
    given = {mount: icub.T_root_camera(angles_rad, mount) for mount in icub.T_head_camera}
    mounts = [mount for mount, T in given.items() if _is_same(T, recorded)]
    if not mounts:
        raise InputError(
            f"{recording.folder / rec.JOINTS_FILE}: the joints ({', '.join(columns)}) do not give the camera "
            f"poses with any of the holders {', '.join(given)}; record both with the same robot model"
        )
    off_rad = angles_rad + rng.normal(0, amounts.joint_offset_rad, len(columns))
    moved = np.eye(4)
    moved[:3, :3] = rotation(rng.normal(0, amounts.mount_rad, 3))
    moved[:3, 3] = rng.normal(0, amounts.mount_m, 3)
    poses = {(False, False): recorded, (True, False): icub.T_root_camera(off_rad, mounts[0])}
    return poses | {(is_off, True): T @ moved for (is_off, _), T in poses.items()}


def _is_same(T_base_cam: np.ndarray, recorded: np.ndarray) -> bool:
    return T_base_cam.shape == recorded.shape and np.abs(T_base_cam - recorded).max() < _SAME_POSE_M


def reference_shifts(
    recording: rec.Recording,
    true_m: np.ndarray,
    T_base_mocap: np.ndarray,
    amounts: Amounts,
    rng: np.random.Generator,
) -> dict[str, np.ndarray]:
    """Displacements of the motion capture's reference from the true keypoints.

    Parameters
    ----------
    recording : rec.Recording
        Simulated, with motion capture.
    true_m : array, shape (n_frames, n_keypoints, 3)
        True positions (base frame), `JOINTS` first.
    T_base_mocap : array, shape (4, 4)
        The registration's.
    amounts : Amounts
        What is off, and how much.
    rng : numpy.random.Generator
        Of the draws.

    Returns
    -------
    dict of str to array, shape (n_frames, n_keypoints, 3)
        By source: the mean of the two markers relative to the joint (0 where there are none; NaN where one
        was not measured), the registration, and the keypoint's motion during the clock error.
    """
    simulation = rec.read_simulation(recording) or {}
    mocap = read_mocap(recording.mocap_path or recording.folder / rec.MOCAP_FILE)
    exact, n = np.array(simulation["T_base_mocap"]), len(JOINTS)
    means = marker_means(mocap, recording.times_s - simulation["mocap_offset_s"], exact)
    markers_m = np.zeros_like(true_m)
    markers_m[:, :n] = position_array(means, JOINTS, len(recording)) - true_m[:, :n]
    late_s = rng.normal(0, amounts.clock_s) + rng.normal(0, amounts.jitter_s, len(recording))
    ways = CubicSpline(recording.times_s, true_m)
    return {
        MARKERS: markers_m,
        REGISTRATION: transform(T_base_mocap @ np.linalg.inv(exact), true_m) - true_m,
        CLOCK: ways(recording.times_s + late_s) - true_m,
    }
