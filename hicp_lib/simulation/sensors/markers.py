"""Reflective markers of motion capture: where a lab tapes them, and where they are in a pose.

Two on each shoulder, elbow and wrist: on opposite sides of elbow and wrist, so that their mean is near
the joint (the paper's section IV-C takes that mean for the joint), and both on the outer side of the
shoulder, as there, where their mean lies beside it; one on the depth camera.
"""

import numpy as np

from hicp_lib.core.keypoints import INDEX
from hicp_lib.core.memo import memoised
from hicp_lib.simulation.body.model import Body, PosedBody, Shape, load_body, pose_body
from hicp_lib.simulation.rendering.mesh import Mesh
from hicp_lib.simulation.rendering.raycast import RayScene
from hicp_lib.simulation.rendering.surfaces import Look, Surface

SIDES = {
    "shoulder": ((0.6, 0.8, 0), (-0.6, 0.8, 0)),  # outer side, one towards the front, one the back
    "elbow": ((0, 1, 0), (0, -1, 0)),  # outer and inner epicondyle, the ends of the hinge's axis
    "wrist": ((1, 0, 0), (-1, 0, 0)),  # styloid processes: thumb's side, little finger's side
}
"""Directions from each joint to its two markers when the left arm hangs and its palm faces the thigh,
in body axes, of length 1; mirrored for the right."""

JOINT_MARKERS: tuple[str, ...] = tuple(
    f"{joint}_{side}_{number}" for joint in SIDES for side in ("left", "right") for number in (1, 2)
)
"""Names of the twelve markers on a person, in the order used throughout."""

CAMERA_MARKER = "camera"
CAMERA_MARKER_M = (0.0325, -0.0185, -0.008)
"""The marker on the depth camera in the colour camera's frame: in the middle of the D435's top. The
colour camera lies 32.5 mm beside that middle, 12.5 mm below the top and 4 mm behind the front of the
housing, which is 25 mm deep; the marker's own radius is 6 mm."""

_UNSEEN = Look(np.zeros((3, 1)))  # these scenes are only for casting rays

_BELOW_SHOULDER = 0.3  # of the way from shoulder to elbow

_CELL_M = 0.015  # edge of the cells that the skin is thinned out by

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


@memoised(64)
def marker_vertices(shape: Shape) -> np.ndarray:
    """Vertices of the body model that the markers are taped to.

    In the reference stance, the skin that a line from the joint's centre comes out through.

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
    >>> person = pose_body(load_body(), "man_38_07", {})
    >>> front, back = markers_m(person, marker_vertices("man_38_07"))[:2]  # of the left shoulder
    >>> bool(front[0] > back[0] + 0.05)
    True
    """
    body = load_body()
    person = pose_body(body, shape, {})
    arm = (body.field("arm") > _BELOW_SHOULDER)[body.triangles].all(axis=1)
    parts = [_place(body, person, "shoulder", np.ones_like(arm))]
    # A heavy person's trunk may touch the hanging arm: the trunk is no place for the elbow's marker.
    parts += [_place(body, person, joint, arm) for joint in ("elbow", "wrist")]
    return np.concatenate(parts)


def _place(body: Body, person: PosedBody, joint: str, chosen: np.ndarray) -> np.ndarray:
    """Vertices for a joint's four markers, on some of the triangles: left 1, left 2, right 1, right 2."""
    mirrors = {"left": np.array([1, 1, 1]), "right": np.array([1, -1, 1])}
    directions = np.concatenate([mirror * np.array(SIDES[joint]) for mirror in mirrors.values()])
    centres = np.repeat([person.keypoints_m[INDEX[f"{side}_{joint}"]] for side in mirrors], 2, axis=0)
    triangles = body.triangles[chosen]
    trace = RayScene([_bare(person, triangles)]).trace(np.hstack([centres, directions]).astype(np.float32))
    out = centres + trace.depth_m[:, None] * directions
    corners = triangles[trace.triangle]
    nearest = np.linalg.norm(person.vertices_m[corners] - out[:, None], axis=2).argmin(axis=1)
    return corners[np.arange(len(corners)), nearest]


def body_scene(person: PosedBody, obstacles: tuple[Mesh, ...] = ()) -> RayScene:
    """What may hide markers: the person's skin, and other meshes. Markers lie on clothes, not under them.

    The skin is that between every few vertices: as good as all of it, and ready in a third of the time.

    Parameters
    ----------
    person : PosedBody
    obstacles : tuple of Mesh, optional
    """
    skin = _bare(person, _coarse_triangles())
    return RayScene([skin, *(Surface(mesh, _UNSEEN) for mesh in obstacles)])


@memoised(1)
def _coarse_triangles() -> np.ndarray:
    """The body's triangles between one vertex of each cell of space, (n, 3): the nearest to its middle."""
    body = load_body()
    rest = body.vertices_m.mean(axis=0)
    _, cell = np.unique((rest // _CELL_M).astype(int), axis=0, return_inverse=True)
    count = np.bincount(cell)
    middles = np.stack([np.bincount(cell, column) / count for column in rest.T], axis=1)
    by_distance = np.argsort(np.linalg.norm(rest - middles[cell], axis=1), kind="stable")
    _, first = np.unique(cell[by_distance], return_index=True)
    corners = by_distance[first][cell][body.triangles]
    flat = (corners == np.roll(corners, 1, axis=1)).any(axis=1)
    return corners[~flat].astype(np.int32)


def _bare(person: PosedBody, triangles: np.ndarray) -> Surface:
    no_coords = np.zeros((len(person.vertices_m), 0))
    return Surface(Mesh(person.vertices_m, triangles, person.normals, no_coords), _UNSEEN)
