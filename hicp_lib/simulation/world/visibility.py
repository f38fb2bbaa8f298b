"""Visibility of keypoints to a camera."""

import numpy as np

from hicp_lib.core.keypoints import HANDS, INDEX, N_KEYPOINTS
from hicp_lib.simulation.appearance.people import RIGHT
from hicp_lib.simulation.body.identities import PEOPLE
from hicp_lib.simulation.body.model import REGIONS
from hicp_lib.simulation.rendering.camera import PlacedCamera, pixel_rays, project_world
from hicp_lib.simulation.rendering.raycast import RayScene

_TOUCHING_M = 0.002  # a keypoint at most this far behind the visible surface is on it
_RULES = PEOPLE["seen_through"]


def _tables() -> tuple[np.ndarray, np.ndarray]:
    """Parts that keypoints may be seen through, (136, n_parts + 1), the last for no part; depths (136,)."""
    allowed = np.zeros((N_KEYPOINTS, 2 * RIGHT + 1), bool)
    depth_m = np.zeros(N_KEYPOINTS)
    for name, index in INDEX.items():
        otherwise = _RULES["any of a hand" if index in HANDS else "any of the face"]
        rules = (rule for ending, rule in _RULES.items() if name.endswith(ending))
        parts, depth_m[index] = next(rules, otherwise)
        for part in parts:
            number, sided = REGIONS.index(part), part in PEOPLE["on_each_side"]
            allowed[index, number] = not (sided and name.startswith("right_"))
            allowed[index, number + RIGHT] = not (sided and name.startswith("left_"))
    return allowed, depth_m


_ALLOWED, _DEPTH_M = _tables()


def keypoint_visibility(
    scene: RayScene, camera: PlacedCamera, keypoints_m: np.ndarray, person: int
) -> tuple[np.ndarray, np.ndarray]:
    """Pixels of a person's keypoints, and whether they are visible.

    A ray goes from the camera to each keypoint. The keypoint is visible if the ray meets
    nothing before it, or first meets the same person, on a body part that the joint belongs to
    and of the joint's own side, no further in front of it than flesh and cloth are thick there:
    3 cm for the face, 2.5 cm for fingers, 6 to 22 cm for the joints of limbs, shoulders and
    hips. Clothes count as the part they cover, hair as the scalp; so a knee under trousers is
    visible, an ear under hair or the far eye of a face in profile is not.

    Parameters
    ----------
    scene : RayScene
    camera : PlacedCamera
    keypoints_m : array, shape (136, 3)
        World frame.
    person : int
        Index of their person.

    Returns
    -------
    pixels_px : array, shape (136, 2)
    visibility : array of int, shape (136,)
        2 visible, 1 occluded, 0 outside the image.
    """
    pixels_px, depths_m = project_world(camera, keypoints_m)
    inside = camera.contains(pixels_px)
    rays = pixel_rays(camera, np.where(inside[:, None], pixels_px, 0))
    trace = scene.trace(rays)
    stretch = np.linalg.norm(rays[:, 3:], axis=1)
    before_m = (depths_m - trace.depth_m) * stretch
    owner, parts = scene.owners[trace.surface], scene.parts[trace.triangle]
    own = (owner == person) & _ALLOWED[np.arange(N_KEYPOINTS), parts] & (before_m <= _DEPTH_M)
    visible = (before_m <= _TOUCHING_M) | own
    return pixels_px, np.where(inside, np.where(visible, 2, 1), 0)
