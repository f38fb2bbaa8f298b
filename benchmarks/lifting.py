"""What lifting a frame costs beside a loop over keypoints, and what the better estimator costs.

One person's 136 keypoints in a depth image of 640 x 480 with holes: all of the person in the image at 2.4 m,
and the upper body at 1 m, where neighbourhoods are larger. The baseline is the paper's method as one
writes it first, keypoint by keypoint with NumPy; it must give the same points. The better estimator is
compared with the paper's. Processor time: set `OMP_NUM_THREADS=1`.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from timing import Comparison, best_seconds, run

from hicp_lib.core.camera import Camera, deproject
from hicp_lib.core.keypoints import INDEX
from hicp_lib.lifting.paper import RADIUS_M, lift
from hicp_lib.lifting.robust import lift_robust
from hicp_lib.simulation.body.model import load_body, pose_body
from hicp_lib.simulation.rendering.camera import PlacedCamera, look_at, pixel_rays, project_world
from hicp_lib.simulation.sensors.markers import body_scene

INTRINSICS = Camera(640, 480, 615.0, 615.0, 319.5, 239.5)
VIEWS = {"whole person, 2.4 m": ("mid_hip", 2.4), "upper body, 1 m": ("neck", 1.0)}
HOLES = 0.02  # share of pixels without depth


def make_frame(middle: str, distance_m: float) -> tuple[np.ndarray, np.ndarray]:
    """Keypoints (1, 136, 2) and depth (480, 640) float32 of a person before a wall."""
    person = pose_body(load_body(), "woman_35_06", {})
    target_m = person.keypoints_m[INDEX[middle]] + [0, 0, -0.05]
    pose = look_at(target_m + [distance_m, 0, 0], target_m)
    camera = PlacedCamera(640, 480, 615.0, 615.0, 319.5, 239.5, pose)
    depth_m = body_scene(person).trace(pixel_rays(camera)).depth_m.reshape(480, 640)
    depth_m = np.where(np.isfinite(depth_m), depth_m, distance_m + 1).astype(np.float32)
    depth_m[np.random.default_rng(0).random(depth_m.shape) < HOLES] = 0
    return project_world(camera, person.keypoints_m)[0][None], depth_m


def lift_one_by_one(keypoints_px: np.ndarray, depth_m: np.ndarray, intrinsics: Camera) -> np.ndarray:
    """The baseline: (n, 136, 3); keypoints on holes are left out, which the paper's text does not treat."""
    points_m = np.full((*keypoints_px.shape[:2], 3), np.nan)
    for person, keypoint in np.ndindex(keypoints_px.shape[:2]):
        u, v = keypoints_px[person, keypoint]
        if np.isnan(u) or not (
            -0.5 <= u < intrinsics.width_px - 0.5 and -0.5 <= v < intrinsics.height_px - 0.5
        ):
            continue
        column, row = int(np.floor(u + 0.5)), int(np.floor(v + 0.5))
        if not depth_m[row, column] > 0:
            continue
        half = int(intrinsics.fx_px * RADIUS_M[keypoint] / depth_m[row, column])
        top, left = max(row - half, 0), max(column - half, 0)
        piece = depth_m[top : row + half + 1, left : column + half + 1]
        rows, columns = np.nonzero(piece > 0)
        pixels_px = np.stack([columns + left, rows + top], axis=-1)
        around_m = deproject(intrinsics, pixels_px, piece[rows, columns])
        points_m[person, keypoint] = np.median(around_m, axis=0)
    return points_m


def compare(view: str, turns: int) -> Iterator[Comparison]:
    frame = (*make_frame(*VIEWS[view]), INTRINSICS)
    ours_m, base_m = lift(*frame).points_m, lift_one_by_one(*frame)
    both = np.isfinite(base_m)
    if not np.allclose(ours_m[both], base_m[both], atol=1e-6):
        raise SystemExit(f"{view}: the loop gives other points")
    ours_s, base_s, robust_s = best_seconds(
        lambda: lift(*frame), lambda: lift_one_by_one(*frame), lambda: lift_robust(*frame),
        turns=turns, calls=min(turns, 10),
    )  # fmt: skip
    yield Comparison(f"lift a frame as in the paper, {view}", ours_s, "keypoint by keypoint", base_s)
    yield Comparison(f"lift a frame robustly, {view}", robust_s, "as in the paper", ours_s)


def measure(options) -> Iterator[Comparison]:
    for view in VIEWS:
        yield from compare(view, options.turns)


if __name__ == "__main__":
    run(measure, __doc__, turns=(20, 1))
