"""Camera poses from the user: joint angles of the robot, or trajectories in other tools' formats.

These are TUM, where a single line means a camera that does not move, EuRoC, KITTI, and Open3D's
`trajectory.log`.
"""

from pathlib import Path

import numpy as np

from hicp_lib.core.errors import InputError
from hicp_lib.core.files import read_bytes
from hicp_lib.recordings.recording import read_csv
from hicp_lib.recordings.tum import MAX_PLACE_M, names_poses, read_poses
from hicp_lib.recordings.writer import Poses

_ROTATION_TOLERANCE = 0.01  # tolerance of R Rᵀ from the identity, since files are rounded
_MOST = 1e11  # larger values are neither seconds nor degrees


def read_pose_source(path: str | Path | None, mount: str = "level") -> Poses:
    """Poses from a trajectory (`read_trajectory`), or a CSV of joint angles by the robot's kinematics.

    A CSV has a column `t_s` and one of degrees for every joint of torso and neck, such as
    `torso_pitch_deg`. Without a file the base frame is the camera's own.

    Parameters
    ----------
    path : str or Path or None
    mount : str, optional
        Camera holder, for joint angles: "level" or "tilted".

    Returns
    -------
    times_s : array, shape (m,)
        One time if the camera does not move, none if the poses are one per frame.
    T_base_cam : array, shape (m, 4, 4)
        Camera coordinates to the robot's base frame.

    Raises
    ------
    InputError
        If the file cannot be read, or a column or number is missing.

    Examples
    --------
    >>> times_s, T_base_cam = read_pose_source(None)
    >>> times_s.shape, T_base_cam.shape
    ((1,), (1, 4, 4))
    """
    if path is None:
        return np.zeros(1), np.eye(4)[None]
    path = Path(path)
    if path.suffix.lower() != ".csv" or names_poses(path):
        return read_trajectory(path)
    from hicp_lib.robot.kinematics import HEAD_JOINTS, load_icub  # not in every installation

    numbers = read_csv(path, ["t_s", *(f"{joint}_deg" for joint in HEAD_JOINTS)]).to_numpy(float)
    is_bad = ~(np.abs(numbers) <= _MOST).all(axis=1) | (np.diff(numbers[:, 0], prepend=-np.inf) <= 0)
    if is_bad.any() or len(numbers) == 0:
        row = 1 + int(np.argmax([*is_bad, True]))
        raise InputError(f"{path}: row {row}: expected numbers, and a t_s after the one before")
    return numbers[:, 0], load_icub().T_root_camera(np.radians(numbers[:, 1:]), mount)


def read_trajectory(path: str | Path) -> tuple[np.ndarray, np.ndarray]:
    """Read camera poses in any of these formats, recognised by the content.

    Lines of 12 numbers are KITTI's matrices of 3 x 4; lines of 3, 4, 4, 4 and 4 numbers are one pose in
    Open3D's log. Both have one pose per frame and no times. Everything else is read by
    `hicp_lib.recordings.tum.read_poses`.

    Parameters
    ----------
    path : str or Path

    Returns
    -------
    times_s : array, shape (n,)
        Increasing; of length 0 if there is one pose per frame.
    T_base_cam : array, shape (n, 4, 4)
        Camera coordinates to the file's own world, metres.

    Raises
    ------
    InputError
        If the file cannot be read or has another format, or a matrix is not a rigid transform.
    """
    text = read_bytes(path, "give a file of camera poses").decode("latin-1")
    rows = [fields for line in text.splitlines() if (fields := line.partition("#")[0].split())]
    widths = {len(fields) for fields in rows}
    is_log = [len(fields) for fields in rows[:2]] == [3, 4]
    if widths != {12} and not is_log:
        return read_poses(path)
    T_base_cam = np.tile(np.eye(4), (len(rows) // 5 if is_log else len(rows), 1, 1))
    try:
        numbers = np.array([x for row in rows for x in row], float).reshape(len(T_base_cam), -1)
        T_base_cam[:, : 4 if is_log else 3] = numbers[:, 3 * is_log :].reshape(len(T_base_cam), -1, 4)
    except ValueError:
        expected = "'k k k+1' and a matrix of 4 x 4" if is_log else "12 numbers in every line"
        raise InputError(f"{path}: is cut off or damaged; expected {expected}") from None
    R, last = T_base_cam[:, :3, :3], T_base_cam[:, 3]
    R[np.abs(R).max(axis=(1, 2)) > 2] = 0  # not a rotation, and too large to be squared
    off = np.abs(R @ R.swapaxes(1, 2) - np.eye(3)).max(axis=(1, 2)) + np.abs(last - [0, 0, 0, 1]).max(axis=1)
    is_near = (np.abs(T_base_cam[:, :3, 3]) <= MAX_PLACE_M).all(axis=1)
    is_pose = is_near & (off <= _ROTATION_TOLERANCE) & (np.linalg.det(R) > 0)
    if is_log:
        is_pose &= (numbers[:, :2] == numbers[0, 0] + np.arange(len(numbers))[:, None]).all(axis=1)
    if not is_pose.all():
        wrong = f"pose {1 + np.argmin(is_pose)} is no rotation and translation, or not of the next frame"
        raise InputError(f"{path}: {wrong}; export it again")
    return np.zeros(0), T_base_cam
