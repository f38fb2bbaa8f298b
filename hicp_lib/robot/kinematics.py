"""Kinematics of the iCub: poses of its links and its camera, and positions of its skin.

Root frame: origin on the axis of torso pitch, between the legs; metres, x backward, y to the robot's
right, z up. Angles in radians, without clamping to the limits. Every chain begins at the root with the
three joints of the torso, in the order pitch, roll, yaw (motor boards report another one: see `motor_order`).
Poses and Jacobians are Pinocchio's, on models built from the tables in data/icub.json.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from hicp_lib.core.errors import InputError
from hicp_lib.robot.tables import Row, Tables, read_tables

TORSO_JOINTS = ("torso_pitch", "torso_roll", "torso_yaw")
HEAD_JOINTS = (*TORSO_JOINTS, "neck_pitch", "neck_roll", "neck_yaw")
ARM_JOINTS = (
    *TORSO_JOINTS, "shoulder_pitch", "shoulder_roll", "shoulder_yaw",
    "elbow", "wrist_prosup", "wrist_pitch", "wrist_yaw",
)  # fmt: skip
"""Joints of the head chain, and of either arm's; the angles of a chain come in this order."""


class Chain:
    """A chain of joints from the root to a hand, the head centre or an eye.

    One object serves one thread at a time: Pinocchio keeps its intermediate results in it.

    Attributes
    ----------
    name : str
        "head", "left", "right", "left_eye" or "right_eye".
    joints : tuple of str
        n of them, in the order of the angles.
    links : tuple of str
        The frames after each row of the Denavit-Hartenberg table.
    limits_rad : array, shape (n, 2)
        Lowest and highest angle of every joint.
    cables : array, shape (k, n)
        Sums of angles limited by cables (arms only, else k = 0).
    cables_lower_rad, cables_upper_rad : array, shape (k,)
        `lower <= cables @ q <= upper`.
    """

    def __init__(self, name: str, tables: Tables, rows: Sequence[Row], limits: str):
        self.name = name
        self.joints = tuple(joint for joint, *_ in rows if joint)
        self.links = tuple(link for _, link, *_ in rows)
        self.limits_rad = np.array([tables.limits_rad[limits][joint] for joint in self.joints])
        mine = [(factors, sums) for factors, sums in tables.cables if factors.keys() <= set(self.joints)]
        rows_of_factors = [[factors.get(joint, 0.0) for joint in self.joints] for factors, _ in mine]
        self.cables = np.reshape(rows_of_factors, (len(mine), len(self.joints)))
        self.cables_lower_rad, self.cables_upper_rad = np.reshape([sums for _, sums in mine], (-1, 2)).T
        self._model = _model(tables.T_root_base, rows)
        self._data = self._model.createData()
        self._frames = {link: self._model.getFrameId(link) for link in self.links}

    def T_root_link(self, link: str, q_rad: np.ndarray) -> np.ndarray:
        """Poses of a link in the root frame.

        Parameters
        ----------
        link : str
            One of `links`.
        q_rad : array, shape (..., n)
            Angles in the order of `joints`.

        Returns
        -------
        array, shape (..., 4, 4)

        Raises
        ------
        ValueError
            For an unknown link.

        Examples
        --------
        >>> hand = load_icub().chains["left"].T_root_link("hand", np.zeros(10))
        >>> hand[:3, 3].round(3)
        array([-0.011, -0.094, -0.177])
        """
        q = np.asarray(q_rad, dtype=float)
        frame = self._frame(link)
        poses = np.empty((*q.shape[:-1], 4, 4))
        for index in np.ndindex(q.shape[:-1]):
            pin.forwardKinematics(self._model, self._data, q[index])
            poses[index] = pin.updateFramePlacement(self._model, self._data, frame).homogeneous
        return poses

    def T_root_links(self, q_rad: np.ndarray) -> dict[str, np.ndarray]:
        """Poses of all links in the root frame.

        Parameters
        ----------
        q_rad : array, shape (n,)
            Angles in the order of `joints`.

        Returns
        -------
        dict of str to array, shape (4, 4)
            By link.
        """
        pin.framesForwardKinematics(self._model, self._data, np.asarray(q_rad, dtype=float))
        return {link: self._data.oMf[frame].homogeneous for link, frame in self._frames.items()}

    def jacobian(self, link: str, q_rad: np.ndarray, points_link_m: np.ndarray | None = None) -> np.ndarray:
        """Jacobian of points fixed to a link.

        Parameters
        ----------
        link : str
            One of `links`.
        q_rad : array, shape (n,)
            Angles in the order of `joints`.
        points_link_m : array, shape (..., 3), optional
            Points in the link's frame; by default its origin.

        Returns
        -------
        array, shape (..., 3, n)
            Metres per radian along the axes of the root frame.

        Raises
        ------
        ValueError
            For an unknown link.
        """
        frame = self._frame(link)
        q, axes = np.asarray(q_rad, dtype=float), pin.LOCAL_WORLD_ALIGNED
        full = pin.computeFrameJacobian(self._model, self._data, q, frame, axes)
        if points_link_m is None:
            return full[:3].copy()
        # v = v_origin + w x r, with r from the link's origin to the point, in root axes
        x, y, z = np.moveaxis(np.asarray(points_link_m) @ self._data.oMf[frame].rotation.T, -1, 0)[..., None]
        wx, wy, wz = full[3:]
        return full[:3] + np.stack([wy * z - wz * y, wz * x - wx * z, wx * y - wy * x], axis=-2)

    def _frame(self, link: str) -> int:
        if link not in self._frames:
            raise ValueError(f"the {self.name} chain has no link {link!r}; it has {', '.join(self.links)}")
        return self._frames[link]


@dataclass(frozen=True, eq=False)
class ICub:
    """An iCub: its chains, its camera holders, and the links that carry its skin.

    Attributes
    ----------
    chains : dict of str to Chain
        "head" (6 joints), "left" and "right" (10), "left_eye" and "right_eye" (8).
    T_head_camera : dict of str to array, shape (4, 4)
        Name of the camera holder -> colour camera in the frame of link "head".
    parts : dict of str to tuple of str
        Part of the skin -> (chain, link).
    """

    chains: dict[str, Chain]
    T_head_camera: dict[str, np.ndarray]
    parts: dict[str, tuple[str, str]]

    def T_root_camera(self, head_rad: np.ndarray, mount: str = "level") -> np.ndarray:
        """Poses of the colour camera (x right, y down, z forward) in the root frame.

        Parameters
        ----------
        head_rad : array, shape (..., 6)
            Angles of `HEAD_JOINTS`.
        mount : str, optional
            Camera holder, "level" (looks 5.9 degrees down) or "tilted" (44.8 degrees).

        Returns
        -------
        array, shape (..., 4, 4)

        Raises
        ------
        ValueError
            For an unknown holder.
        """
        if mount not in self.T_head_camera:
            raise ValueError(f"no camera holder {mount!r}; there are {', '.join(self.T_head_camera)}")
        return self.chains["head"].T_root_link("head", head_rad) @ self.T_head_camera[mount]


def load_icub(head: str = "v2", arm: str = "v1", limits: str = "table") -> ICub:
    """An iCub of the given versions.

    The versions of the paper's robot are not published; assumed are head "v2" (on which the camera holders
    were measured) and arm "v1" (whose table reproduces logged positions of a real robot).

    Parameters
    ----------
    head : str, optional
        "v1" or "v2".
    arm : str, optional
        "v1", "v1.7" or "v2".
    limits : str, optional
        "table", the mechanical ones, or "software", the tighter ones of the robot's firmware.

    Returns
    -------
    ICub

    Raises
    ------
    InputError
        For an unknown version or set of limits.

    Examples
    --------
    >>> icub = load_icub(limits="software")
    >>> np.rad2deg(icub.chains["left"].limits_rad[ARM_JOINTS.index("elbow")]).round(1)
    array([ 15., 106.])
    """
    tables = read_tables()
    for name, known in ((head, tables.heads), (arm, tables.arms), (limits, tables.limits_rad)):
        if name not in known:
            raise InputError(f"no {name!r} in the robot's tables; choose one of {', '.join(known)}")
    rows = tables.heads[head] | tables.arms[arm]
    chains = {name: Chain(name, tables, table, limits) for name, table in rows.items()}
    return ICub(chains, tables.T_head_camera, tables.parts)


def _model(T_root_base: np.ndarray, rows: Sequence[Row]) -> pin.Model:
    """A serial model with a joint about z for each row that has one, and a frame after every row."""
    model = pin.Model()
    joint, placement = 0, pin.SE3(T_root_base)
    for name, link, a_m, d_m, alpha_rad, offset_rad in rows:
        if name:
            joint = model.addJoint(joint, pin.JointModelRZ(), placement, name)
            placement = pin.SE3.Identity()
        turn = pin.SE3(pin.utils.rotate("z", offset_rad), np.array([0.0, 0.0, d_m]))
        placement = placement * (turn * pin.SE3(pin.utils.rotate("x", alpha_rad), np.array([a_m, 0.0, 0.0])))
        model.addFrame(pin.Frame(link, joint, 0, placement, pin.FrameType.OP_FRAME))
    return model
