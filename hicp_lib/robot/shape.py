"""The robot's appearance as triangles on its links: covers, joints, hands with fingers, face, camera."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from hicp_lib.core.datafiles import DATA_DIR, read_arrays
from hicp_lib.core.memo import memoised
from hicp_lib.robot.kinematics import ICub
from hicp_lib.robot.posture import Posture
from hicp_lib.robot.segments import link_poses

SHAPE_FILE = DATA_DIR / "icub_shape.npz"
STEP_M = 2e-5  # vertices are stored as integer multiples of this
_STORED = {"links": (-1,), "vertices_20um": (-1, 3), "vertex_link": (-1,), "triangles": (-1, 3)}
_STORED |= {"vertex_colour": (-1,), "colours": (-1, 3)}
_UNSEEN = ("head head", "head neck_roll", "camera", "root")


@dataclass(frozen=True, eq=False)
class Shape:
    """A triangle mesh of the robot.

    Attributes
    ----------
    vertices_m : array, shape (n, 3), dtype float32
        In the root frame.
    triangles : array, shape (n_triangles, 3), dtype int32
        Outward.
    colours : array, shape (n, 3), dtype float32
        Linear RGB of every vertex.
    unseen : array of bool, shape (n_triangles,)
        Invisible to the camera on the head: the camera itself, neck, head, pelvis and legs.
    """

    vertices_m: np.ndarray
    triangles: np.ndarray
    colours: np.ndarray
    unseen: np.ndarray


def robot_shape(icub: ICub, posture: Posture, mount: str = "tilted") -> Shape:
    """The robot in a posture.

    Parameters
    ----------
    icub : ICub
    posture : Posture
    mount : str, optional
        Holder of the camera on the head.

    Returns
    -------
    Shape

    Raises
    ------
    InputError
        If data/icub_shape.npz is missing or was not made by tools/bake_robot.py.

    Examples
    --------
    >>> from hicp_lib.robot.kinematics import load_icub
    >>> shape = robot_shape(load_icub(), Posture())
    >>> shape.vertices_m.min(axis=0).round(1)  # its soles are 0.6 m below the root
    array([-0.1, -0.2, -0.6], dtype=float32)
    """
    stored, poses = _stored(), link_poses(icub, posture, mount)
    T = np.array([poses[link] for link in stored["links"]])[stored["vertex_link"]]
    local_m = STEP_M * stored["vertices_20um"]
    vertices_m = np.einsum("nij,nj->ni", T[:, :3, :3], local_m) + T[:, :3, 3]
    unseen = np.isin(stored["links"], _UNSEEN)[stored["vertex_link"]]
    triangles = stored["triangles"].astype(np.int32)
    colours = stored["colours"][stored["vertex_colour"]]
    return Shape(vertices_m.astype(np.float32), triangles, colours, unseen[triangles[:, 0]])


@memoised(2)
def _stored(path: Path = SHAPE_FILE) -> dict[str, np.ndarray]:
    arrays = read_arrays(path, _STORED, "the robot's shape", "tools/bake_robot.py")
    return dict(zip(_STORED, arrays, strict=True))
