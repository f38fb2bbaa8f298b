"""Reflective markers of motion capture: their attachment to the body, and positions in a pose.

Two on each shoulder, elbow and wrist: on opposite sides of elbow and wrist, so that their mean is near
the joint (the paper's section IV-C takes that mean for the joint), and both on the outer side of the
shoulder, as there, where their mean lies beside it; one on the depth camera.
"""

import numpy as np

from hicp_lib.core.datafiles import DATA_DIR, read_arrays
from hicp_lib.core.memo import memoised
from hicp_lib.simulation.body.identities import PEOPLE
from hicp_lib.simulation.body.model import PosedBody, Shape, load_body, shape_number
from hicp_lib.simulation.rendering.mesh import Mesh
from hicp_lib.simulation.rendering.raycast import RayScene
from hicp_lib.simulation.rendering.surfaces import Look, Surface

JOINT_MARKERS: tuple[str, ...] = tuple(PEOPLE["markers"])
"""Names of the twelve markers on a person, in the order used throughout."""

CAMERA_MARKER = "camera"
CAMERA_MARKER_M = (0.0325, -0.0185, -0.008)
"""The marker on the depth camera in the colour camera's frame: in the middle of the D435's top. The
colour camera lies 32.5 mm beside that middle, 12.5 mm below the top and 4 mm behind the front of the
housing, which is 25 mm deep; the marker's own radius is 6 mm."""

_UNSEEN = Look(np.zeros((3, 1)))  # these scenes are only for casting rays

STANDOFF_M = 0.012
"""From the skin to a marker's centre: cloth or tape, the marker's base, and its radius of 6 mm."""


def markers_m(person: PosedBody, vertices: np.ndarray) -> np.ndarray:
    """Centres of the markers on a posed person.

    Parameters
    ----------
    person : PosedBody
    vertices : array of int, shape (12,)
        Those of `marker_vertices` for the person's shape.

    Returns
    -------
    array, shape (12, 3)
        In the frame the person is posed in.
    """
    return (person.vertices_m[vertices] + STANDOFF_M * person.normals[vertices]).astype(float)


def camera_marker_m(T_world_camera: np.ndarray) -> np.ndarray:
    """The marker on the depth camera, (..., 3), from poses (..., 4, 4) of the colour camera."""
    T = np.asarray(T_world_camera, float)
    return T[..., :3, :3] @ np.array(CAMERA_MARKER_M) + T[..., :3, 3]


def marker_vertices(shape: Shape) -> np.ndarray:
    """Vertices of the body model that the markers are taped to.

    Parameters
    ----------
    shape : int or str
        As in `pose_body`.

    Returns
    -------
    array of int, shape (12,)
        In the order of `JOINT_MARKERS`.

    Examples
    --------
    >>> from hicp_lib.simulation.body.model import pose_body
    >>> person = pose_body(load_body(), "man_38_07", {})
    >>> front, back = markers_m(person, marker_vertices("man_38_07"))[:2]  # of the left shoulder
    >>> bool(front[0] > back[0] + 0.05)
    True
    """
    return _measured()[0][shape_number(load_body(), shape)]


@memoised()
def _measured() -> tuple[np.ndarray, np.ndarray]:
    """Vertices with markers by shape, (n_shapes, 12), and triangles between every few vertices, (n, 3)."""
    arrays = {"markers": (-1, 12), "thinned": (-1, 3)}
    found = read_arrays(DATA_DIR / "body_sizes.npz", arrays, "sizes of bodies", "tools/measure_sizes.py")
    return found[0].astype(np.int32), found[1].astype(np.int32)


def body_scene(person: PosedBody, obstacles: tuple[Mesh, ...] = ()) -> RayScene:
    """Occluders of markers: the person's skin, and other meshes. Markers are on clothes, not under them.

    The skin is reduced to some of its vertices: equally good, and ready in a third of the time.

    Parameters
    ----------
    person : PosedBody
    obstacles : tuple of Mesh, optional
    """
    no_coords = np.zeros((len(person.vertices_m), 0))
    skin = Mesh(person.vertices_m, _measured()[1], person.normals, no_coords)
    return RayScene([Surface(mesh, _UNSEEN) for mesh in (skin, *obstacles)])
