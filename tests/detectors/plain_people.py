"""Plainly rendered people with known keypoints: a body in flat colours before a flat wall."""

from __future__ import annotations

import numpy as np
import open3d

from hicp_lib.core.detections import Detector
from hicp_lib.simulation.body.model import REGIONS, load_body, pose_body
from hicp_lib.simulation.rendering.camera import PlacedCamera, look_at, pixel_rays, project_world

_WALL = (190.0, 190.0, 180.0)
_SKIN = (206.0, 160.0, 134.0)
_HAIR, _SHIRT, _TROUSERS = (60.0, 40.0, 30.0), (70.0, 90.0, 140.0), (60.0, 60.0, 70.0)
_COLOURS = {
    **dict.fromkeys(("scalp", "eyebrow"), _HAIR),
    **dict.fromkeys(("torso", "upper_arm"), _SHIRT),
    **dict.fromkeys(("hips", "thigh", "shin"), _TROUSERS),
}


def render_person(seed: int, distance_m: float = 2.2) -> tuple[np.ndarray, np.ndarray]:
    """One person facing the camera, hands raised beside the shoulders and open.

    Returns
    -------
    image : array (480, 480, 3), RGB uint8
    keypoints_px : array (136, 2)
    """
    rng = np.random.default_rng(seed)
    body = load_body()
    pose = {}
    for side in "LR":
        bend = rng.uniform(-2.3, -1.9)
        pose[f"lowerarm01.{side}"] = np.array([0, bend, 0])
        pose[f"upperarm01.{side}"] = np.array([0.3 if side == "L" else -0.3, rng.uniform(-0.3, 0.3), 0])
    posed = pose_body(body, int(rng.integers(len(body.shape_names))), pose)
    target = posed.keypoints_m[18] - (0, 0, 0.1)
    eye = target + (distance_m, rng.uniform(-0.4, 0.4), rng.uniform(-0.2, 0.2))
    camera = PlacedCamera(480, 480, 600.0, 600.0, 239.5, 239.5, look_at(eye, target))
    return _shade(body, posed, camera), project_world(camera, posed.keypoints_m)[0]


def errors_px(detector: Detector, n: int = 4) -> np.ndarray:
    """How far off (n, 13) the upper bodies of n people are placed, by the surest person found of each."""
    errors = []
    for seed in range(n):
        image, truth_px = render_person(seed)
        found = detector.detect(image)
        best = np.argmax(found.person_scores)
        errors.append(np.linalg.norm(found.keypoints_px[best, :13] - truth_px[:13], axis=1))
    return np.array(errors)


def _shade(body, posed, camera: PlacedCamera) -> np.ndarray:
    scene = open3d.t.geometry.RaycastingScene(nthreads=1)
    scene.add_triangles(posed.vertices_m.astype(np.float32), body.triangles.astype(np.uint32))
    hits = scene.cast_rays(open3d.core.Tensor(pixel_rays(camera)))
    is_hit = np.isfinite(hits["t_hit"].numpy())
    triangles = body.triangles[hits["primitive_ids"].numpy()[is_hit]]
    colours = np.array([_COLOURS.get(region, _SKIN) for region in REGIONS])[body.regions]
    light = np.array([0.6, 0.3, 0.74])
    shade = 0.45 + 0.55 * np.clip(posed.normals @ light, 0, 1)
    pixels = np.tile(_WALL, (len(is_hit), 1))
    pixels[is_hit] = (colours * shade[:, None])[triangles].mean(axis=1)
    return pixels.reshape(camera.height_px, camera.width_px, 3).round().astype(np.uint8)
