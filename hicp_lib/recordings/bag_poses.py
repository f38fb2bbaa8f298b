"""Camera poses from the transforms or joint angles in a ROS bag."""

from collections import defaultdict
from collections.abc import Sequence

import numpy as np

from hicp_lib.core.errors import InputError
from hicp_lib.core.rotations import matrices_from_quaternions
from hicp_lib.recordings.bag_file import Bag, stamp_s
from hicp_lib.recordings.tum import MAX_DIFFERENCE_S, UNIT_TOLERANCE

Link = tuple[str, list[float], list[np.ndarray]]
"""A frame's parent, and times and poses relative to it; no times for a static frame."""


def read_links(bag: Bag) -> dict[str, Link]:
    """The tree of frames, from `tf` and `tf_static`.

    Parameters
    ----------
    bag : Bag

    Returns
    -------
    dict of str to Link
        By the frame's name.

    Raises
    ------
    InputError
        If a frame changes its parent, or is static and moves.
    """
    links: dict[str, Link] = {}
    for topic, _, message in bag.messages(*bag.topics("TFMessage", "tfMessage")):
        for moved in message.transforms:
            parent, frame = moved.header.frame_id.strip("/"), moved.child_frame_id.strip("/")
            known, times_s, T_parent_frame = links.setdefault(frame, (parent, [], []))
            if known != parent:
                raise InputError(f"{bag.path}: {topic}: {frame} is in {known} and in {parent}; keep one")
            times_s += [] if topic.endswith("tf_static") else [stamp_s(moved)]
            T_parent_frame.append(rigid(moved.transform))
            if times_s and len(times_s) < len(T_parent_frame):
                raise InputError(f"{bag.path}: {topic}: {frame} is static and moves in {parent}; keep one")
    return links


def rigid(transform: object) -> np.ndarray:
    """A `Transform` message as a matrix.

    Parameters
    ----------
    transform : object

    Returns
    -------
    array, shape (4, 4)
        Its rotation is NaN if the quaternion is not of length 1.
    """
    T, rotation, moved = np.eye(4), transform.rotation, transform.translation  # type: ignore[attr-defined]
    quaternions = np.array([[rotation.x, rotation.y, rotation.z, rotation.w]])
    is_rotation = abs(np.linalg.norm(quaternions) - 1) <= UNIT_TOLERANCE
    T[:3, :3] = matrices_from_quaternions(quaternions)[0] if is_rotation else np.nan
    T[:3, 3] = moved.x, moved.y, moved.z
    return T


def frame_poses(bag: Bag, links: dict[str, Link], base: str, frame: str, times_s: np.ndarray) -> np.ndarray:
    """Poses of a frame relative to another.

    Parameters
    ----------
    bag : Bag
        For messages.
    links : dict of str to Link
    base, frame : str
    times_s : array, shape (n,)

    Returns
    -------
    array, shape (n, 4, 4)
        Coordinates of `frame` to those of `base`; NaN where a transform is more than 0.02 s away.

    Raises
    ------
    InputError
        If no transforms lead from one to the other, or one of these is no rotation and translation.
    """
    above = {name: _ancestors(links, name) for name in (base, frame)}
    common = next((name for name in above[frame] if name in above[base]), None)
    if common is None:
        known = ", ".join(sorted({*links, *(parent for parent, _, _ in links.values())})) or "none"
        raise InputError(
            f"{bag.path}: no transforms lead from {frame!r} to {base!r}; frames there are: {known}"
        )
    T = {name: np.broadcast_to(np.eye(4), (len(times_s), 4, 4)) for name in above}
    for name, path in above.items():
        for step in path[: path.index(common)]:
            parent, known_s, T_parent = links[step]
            if not np.isfinite(T_parent).all():
                wrong = f"a transform of {step!r} to {parent!r} is no rotation and translation"
                raise InputError(
                    f"{bag.path}: {wrong} (its quaternion is not of length 1, or NaN); record it again"
                )
            T[name] = (_nearest(times_s, known_s, T_parent) if known_s else T_parent[-1]) @ T[name]
    return np.linalg.inv(T[base]) @ T[frame]


def joint_poses(bag: Bag, mount: str, times_s: np.ndarray) -> np.ndarray:
    """Poses of the camera by the robot's kinematics, from messages `JointState` in radians.

    Parameters
    ----------
    bag : Bag
    mount : str
        Camera holder: "level" or "tilted".
    times_s : array, shape (n,)

    Returns
    -------
    array, shape (n, 4, 4)
        Camera coordinates to the root frame; NaN where a joint angle is more than 0.02 s away.

    Raises
    ------
    InputError
        If a joint of torso or neck is missing, or its angles are no radians.
    """
    from hicp_lib.robot.kinematics import HEAD_JOINTS, load_icub  # not in every installation

    series = defaultdict(list)
    for _, _, message in bag.messages(*bag.topics("JointState")):
        for name, angle_rad in zip(message.name, message.position, strict=False):
            series[name].append((stamp_s(message), angle_rad))
    missing = [name for name in HEAD_JOINTS if name not in series]
    if missing:
        known = ", ".join(series) or "none"
        raise InputError(f"{bag.path}: has no joint {missing[0]!r}; joints there are: {known}")
    for name in HEAD_JOINTS:
        if degrees := [angle for _, angle in series[name] if abs(angle) > 2 * np.pi]:
            raise InputError(f"{bag.path}: joint {name!r} is at {degrees[0]:g}; expected radians up to 2 pi")
    angles_rad = [_nearest(times_s, *zip(*series[name], strict=True)) for name in HEAD_JOINTS]
    return load_icub().T_root_camera(np.stack(angles_rad, axis=-1), mount)


def _ancestors(links: dict[str, Link], frame: str) -> list[str]:
    """A frame, its parent, and so on."""
    path = [frame]
    while path[-1] in links and links[path[-1]][0] not in path:
        path.append(links[path[-1]][0])
    return path


def _nearest(times_s: np.ndarray, known_s: Sequence[float], values: Sequence) -> np.ndarray:
    """Values (m, ...) at the nearest known times; NaN where these are too far."""
    order = np.argsort(known_s, kind="stable")
    ordered_s = np.array(known_s)[order]
    nearest = np.searchsorted((ordered_s[1:] + ordered_s[:-1]) / 2, times_s)
    found = np.array(values, float)[order[nearest]]
    found[np.abs(ordered_s[nearest] - times_s) > MAX_DIFFERENCE_S] = np.nan
    return found
