"""Measure every shape of the body model: thickness of trunk and limbs, and positions of markers.

    python tools/measure_sizes.py [--out data/body_sizes.npz]

They serve to sample poses without self-collision, and to place markers of motion capture on the skin. Nothing
is random: the same body model gives the same numbers.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from hicp_lib.core.files import atomic_path
from hicp_lib.core.keypoints import INDEX
from hicp_lib.simulation.body.model import Body, PosedBody, load_body, pose_body, rest_shape
from hicp_lib.simulation.body.self_collision import LIMBS
from hicp_lib.simulation.rendering.mesh import Mesh
from hicp_lib.simulation.rendering.raycast import RayScene
from hicp_lib.simulation.rendering.surfaces import Look, Surface

N_SLICES = 12
HAND_FLATNESS = 0.5  # half the thickness of a hand over its vertices' distance from its middle line
# Directions from each joint to its two markers when the left arm hangs and its palm faces the thigh, in body
# axes, of length 1; mirrored for the right.
SIDES = {
    "shoulder": ((0.6, 0.8, 0), (-0.6, 0.8, 0)),  # outer side, one towards the front, one the back
    "elbow": ((0, 1, 0), (0, -1, 0)),  # outer and inner epicondyle, the ends of the hinge's axis
    "wrist": ((1, 0, 0), (-1, 0, 0)),  # styloid processes: thumb's side, little finger's side
}
BELOW_SHOULDER = 0.3  # of the way from shoulder to elbow
CELL_M = 0.015  # edge of the cells that the skin is thinned out by
DEFAULT_OUT = Path(__file__).parents[1] / "data" / "body_sizes.npz"


def sizes(body: Body, shape: str) -> dict[str, np.ndarray]:
    """Slices of the trunk from below, then the head (13 parts), and limbs: see `CollisionModel`."""
    vertices, heads = rest_shape(body, shape)
    vertices, heads = vertices - heads[0], heads - heads[0]
    trunk, head = (
        np.flatnonzero(body.in_regions(*names)) for names in (("torso", "hips"), ("face", "scalp"))
    )
    z = vertices[trunk, 2]
    edges = np.linspace(z.min(), _extent(z[:, None])[1, 0], N_SLICES + 1)
    parts = [trunk[(z >= low) & (z <= high)] for low, high in zip(edges[:-1], edges[1:], strict=True)]
    parts.append(head)
    low, high = np.stack([_extent(vertices[part]) for part in parts], axis=1)
    half_axes = (high - low) / 2
    half_axes[:-1, 2] = (edges[1] - edges[0]) / 2
    radii = np.array([_radius(body, vertices, heads, limb) for limb in LIMBS])
    radii[[region == "hand" for region, *_ in LIMBS]] *= HAND_FLATNESS
    bones = np.array([body.skin_weights[part].sum(axis=0).argmax() for part in parts], np.uint8)
    return {"bones": bones, "centres_m": (low + high) / 2, "half_axes_m": half_axes, "radii_m": radii}


def _extent(points: np.ndarray) -> np.ndarray:
    """The 3rd and 97th percentile of each component, (2, k), of points (n, k)."""
    ordered = np.sort(points.T, axis=1)
    below, share = np.divmod(np.array([0.03, 0.97]) * (len(points) - 1), 1)
    low, high = ordered[:, below.astype(int)], ordered[:, below.astype(int) + 1]
    return (low + share * (high - low)).T


def _radius(body: Body, vertices: np.ndarray, heads: np.ndarray, limb: tuple) -> float:
    region, first, last, _ = limb
    a, b = (heads[body.bone_numbers[f"{bone}.L"]] for bone in (first, last))
    limb_m = vertices[body.in_regions(region)]
    own = limb_m[limb_m[:, 1] > 0] - a
    along = (b - a) / np.linalg.norm(b - a)
    return float(np.median(np.linalg.norm(own - np.outer(own @ along, along), axis=1)))


def markers(body: Body, shape: str) -> np.ndarray:
    """Vertices that the markers are taped to, (12,): in the reference stance, the skin that a line from the
    joint's centre comes out through."""
    person = pose_body(body, shape, {})
    arm = (body.field("arm") > BELOW_SHOULDER)[body.triangles].all(axis=1)
    parts = [_place(body, person, "shoulder", np.ones_like(arm))]
    # A heavy person's trunk may touch the hanging arm: the trunk is no place for the elbow's marker.
    parts += [_place(body, person, joint, arm) for joint in ("elbow", "wrist")]
    return np.concatenate(parts).astype(np.uint16)


def _place(body: Body, person: PosedBody, joint: str, chosen: np.ndarray) -> np.ndarray:
    """Vertices for a joint's four markers, on some of the triangles: left 1, left 2, right 1, right 2."""
    mirrors = {"left": np.array([1, 1, 1]), "right": np.array([1, -1, 1])}
    directions = np.concatenate([mirror * np.array(SIDES[joint]) for mirror in mirrors.values()])
    centres = np.repeat([person.keypoints_m[INDEX[f"{side}_{joint}"]] for side in mirrors], 2, axis=0)
    triangles = body.triangles[chosen]
    skin = Mesh(person.vertices_m, triangles, person.normals, np.zeros((len(person.vertices_m), 0)))
    scene = RayScene([Surface(skin, Look(np.zeros((3, 1))))])
    trace = scene.trace(np.hstack([centres, directions]).astype(np.float32))
    out = centres + trace.depth_m[:, None] * directions
    corners = triangles[trace.triangle]
    nearest = np.linalg.norm(person.vertices_m[corners] - out[:, None], axis=2).argmin(axis=1)
    return corners[np.arange(len(corners)), nearest]


def thinned(body: Body) -> np.ndarray:
    """The body's triangles between one vertex of each cell of space, (n, 3): the nearest to its middle."""
    rest = body.vertices_m.mean(axis=0)
    _, cell = np.unique((rest // CELL_M).astype(int), axis=0, return_inverse=True)
    count = np.bincount(cell)
    middles = np.stack([np.bincount(cell, column) / count for column in rest.T], axis=1)
    by_distance = np.argsort(np.linalg.norm(rest - middles[cell], axis=1), kind="stable")
    _, first = np.unique(cell[by_distance], return_index=True)
    corners = by_distance[first][cell][body.triangles]
    flat = (corners == np.roll(corners, 1, axis=1)).any(axis=1)
    return corners[~flat].astype(np.uint16)


def measured(body: Body) -> dict[str, np.ndarray]:
    """All that is kept, by name; rows are the body model's shapes."""
    rows = [sizes(body, shape) | {"markers": markers(body, shape)} for shape in body.shape_names]
    return {name: np.stack([row[name] for row in rows]) for name in rows[0]} | {"thinned": thinned(body)}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=DEFAULT_OUT)
    out = parser.parse_args().out
    with atomic_path(out) as temporary:
        np.savez_compressed(temporary, **measured(load_body()))


if __name__ == "__main__":
    main()
