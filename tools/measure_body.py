"""Measure the body model: depths of keypoints below the skin, and distances between them.

    python tools/measure_body.py [--out data/body_measures.npz]

The body measures of the robust lifting, from development bodies only. Distances are the minimum and maximum
over them in random poses of every kind; the depth below the skin is the median over directions from the
front, in the reference stance. Seeds are fixed: the same body model gives the same numbers.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from hicp_lib.core.files import atomic_path
from hicp_lib.core.keypoints import N_KEYPOINTS
from hicp_lib.simulation.body.identities import split_members
from hicp_lib.simulation.body.model import Body, load_body, pose_body
from hicp_lib.simulation.body.poses import KINDS, sample_pose
from hicp_lib.simulation.sensors.markers import body_scene

N_DIRECTIONS = 400
N_POSES = 2  # of every kind and shape
MEASURED = split_members("development")["bodies"]
DEFAULT_OUT = Path(__file__).parents[1] / "data" / "body_measures.npz"


def below_skin_m(body: Body, rng: np.random.Generator) -> np.ndarray:
    """Median way out of the body from every keypoint, (136,), over shapes and directions with x forward."""
    directions = rng.normal(size=(N_DIRECTIONS, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    directions[:, 0] = abs(directions[:, 0])
    ways = []
    for name in MEASURED:
        person = pose_body(body, name, {})
        starts = np.repeat(person.keypoints_m, N_DIRECTIONS, axis=0)
        rays = np.column_stack([starts, np.tile(directions, (N_KEYPOINTS, 1))]).astype(np.float32)
        way = body_scene(person).trace(rays).depth_m
        ways.append(np.where(np.isfinite(way), way, 0).reshape(N_KEYPOINTS, -1))  # none: on the skin
    return np.median(np.median(ways, axis=2), axis=0)


def distances_m(body: Body, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Least and most distance between any two keypoints, (136, 136) each."""
    closest, farthest = np.full((N_KEYPOINTS, N_KEYPOINTS), np.inf), np.zeros((N_KEYPOINTS, N_KEYPOINTS))
    for name in MEASURED:
        for kind in [kind for kind in KINDS for _ in range(N_POSES)]:
            points = pose_body(body, name, sample_pose(rng, body, kind, name)).keypoints_m
            distances = np.linalg.norm(points[:, None] - points, axis=2)
            np.minimum(closest, distances, out=closest)
            np.maximum(farthest, distances, out=farthest)
    return closest, farthest


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=DEFAULT_OUT)
    out = parser.parse_args().out
    body, rng = load_body(), np.random.default_rng(20)
    below = below_skin_m(body, rng)
    tables = {
        "below_skin_mm": below,
        **dict(zip(("closest_mm", "farthest_mm"), distances_m(body, rng), strict=True)),
    }
    with atomic_path(out) as temporary:
        np.savez_compressed(temporary, **{k: np.rint(1000 * v).astype(np.uint16) for k, v in tables.items()})


if __name__ == "__main__":
    main()
