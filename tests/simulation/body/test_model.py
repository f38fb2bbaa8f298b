import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hicp_lib.core.errors import InputError
from hicp_lib.core.files import sha256_file
from hicp_lib.core.keypoints import FACE, INDEX, LEFT_HAND, NAMES
from hicp_lib.core.rotations import rotation
from hicp_lib.simulation.body.identities import traits
from hicp_lib.simulation.body.model import BODY_FILE, REGIONS, load_body, pose_body, pose_bones

BODY = load_body()
SHAPES = st.sampled_from(BODY.shape_names)
SEEDS = st.integers(0, 2**32 - 1)


def random_pose(seed: int) -> dict[str, np.ndarray]:
    rng = np.random.default_rng(seed)
    vectors = rng.normal(0, 0.4, (len(BODY.bone_names), 3))
    return dict(zip(BODY.bone_names, vectors, strict=True))


def rest_pose(shape: int) -> dict[str, np.ndarray]:
    """The pose that undoes the turn to the reference stance."""
    undone = BODY.to_reference[shape].transpose(0, 2, 1)
    parents = np.maximum(BODY.bone_parents, 0)
    local = undone[parents].transpose(0, 2, 1) @ undone
    local[0] = undone[0]
    return dict(zip(BODY.bone_names, local, strict=True))


def mirrored_name(name: str) -> str:
    if name.startswith("face_"):
        return name
    return name.replace("left", "RIGHT").replace("right", "left").replace("RIGHT", "right")


@pytest.mark.parametrize("shape", range(len(BODY.shape_names)))
def test_resting_returns_the_stored_shape(shape):
    posed = pose_body(BODY, shape, rest_pose(shape)).vertices_m
    rest = BODY.vertices_m[shape]
    move = posed.mean(axis=0) - rest.mean(axis=0)
    assert np.abs(posed - rest - move).max() < 1e-5


def test_stands_on_the_floor_below_the_pelvis_and_faces_forward():
    for shape in BODY.shape_names:
        posed = pose_body(BODY, shape, {})
        assert posed.vertices_m[:, 2].min() == pytest.approx(0, abs=1e-5)
        assert posed.heads_m[0, :2] == pytest.approx([0, 0], abs=1e-6)
        k = {name: posed.keypoints_m[i] for i, name in enumerate(NAMES)}
        assert k["nose"][0] > k["left_ear"][0] + 0.05
        assert k["left_big_toe"][0] > k["left_heel"][0] + 0.1
        assert k["head_top"][2] > k["nose"][2] > k["neck"][2] > k["mid_hip"][2] > k["left_knee"][2] > 0.2


def test_left_is_the_persons_left():
    for shape in BODY.shape_names:
        k = pose_body(BODY, shape, {}).keypoints_m
        for name in NAMES:
            if name.startswith("left_"):
                assert k[INDEX[name], 1] > 0.005 > k[INDEX[mirrored_name(name)], 1], name
        # 300-W counts the jaw, the brows, the eyes and the mouth from the person's right.
        for right, left in ((0, 16), (17, 26), (21, 22), (31, 35), (36, 45), (39, 42), (48, 54), (60, 64)):
            assert k[26 + left, 1] > 0 > k[26 + right, 1]


def test_keypoints_are_symmetric_in_the_reference_stance():
    mirror = [INDEX[mirrored_name(name)] for name in NAMES]
    face = [*range(16, -1, -1), *range(26, 16, -1), 27, 28, 29, 30, *range(35, 30, -1)]
    face += [45, 44, 43, 42, 47, 46, 39, 38, 37, 36, 41, 40]
    face += [54, 53, 52, 51, 50, 49, 48, 59, 58, 57, 56, 55, 64, 63, 62, 61, 60, 67, 66, 65]
    mirror[26:94] = [26 + i for i in face]
    for shape in BODY.shape_names:
        k = pose_body(BODY, shape, {}).keypoints_m
        # Both hands of some of MakeHuman's shapes are not quite alike.
        assert np.abs(k[mirror] * (1, -1, 1) - k).max() < 2.5e-3


# Ending of a keypoint's name: regions whose skin is nearest, and how deep (m) below it the point may lie.
PARTS = {
    "shoulder": ("torso upper_arm", 0.09), "elbow": ("upper_arm forearm", 0.06),
    "wrist": ("forearm hand", 0.04),
    "hip": ("hips torso thigh", 0.14), "knee": ("thigh shin", 0.08), "ankle": ("shin foot", 0.06),
    "toe": ("foot nail", 0.03), "heel": ("foot", 0.05), "ear": ("face", 0.02), "nose": ("face", 0.02),
    "eye": ("face eye", 0.015), "head_top": ("scalp", 0.002), "neck": ("neck torso", 0.12),
    "hand_root": ("hand forearm", 0.04),
    **{f"_{joint}": ("hand nail", 0.025) for joint in (1, 2, 3)}, "_4": ("hand nail", 0.006),
}  # fmt: skip


@pytest.mark.parametrize("shape", BODY.shape_names)
def test_keypoints_lie_in_their_part_of_the_body(shape):
    posed = pose_body(
        BODY, shape, {"lowerarm01.L": np.array([0, -1.5, 0]), "finger2-2.R": np.array([1.2, 0, 0])}
    )
    for i, name in enumerate(NAMES):
        ending = next((e for e in PARTS if name.endswith(e)), "")
        regions, depth = PARTS[ending] if i not in FACE else ("face scalp eyebrow lips mouth eye neck", 0.01)
        own = np.isin(BODY.regions, [REGIONS.index(region) for region in regions.split()])
        gap = np.linalg.norm(posed.vertices_m[own] - posed.keypoints_m[i], axis=1).min()
        assert gap < depth, (name, gap)


@given(SHAPES, SEEDS)
@settings(max_examples=20, deadline=None)
def test_bones_keep_their_lengths(shape, seed):
    rest = BODY.heads_m[BODY.shape_names.index(shape)]
    _, posed = pose_bones(BODY, shape, random_pose(seed))
    parents = BODY.bone_parents[1:]
    lengths = [np.linalg.norm(heads[1:] - heads[parents], axis=1) for heads in (rest, posed)]
    assert np.abs(lengths[0] - lengths[1]).max() < 1e-6


@given(SEEDS)
@settings(max_examples=10, deadline=None)
def test_moving_the_person_moves_everything(seed):
    rng = np.random.default_rng(seed)
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = rotation(rng.normal(size=3)), rng.normal(size=3)
    here, there = (pose_body(BODY, 0, random_pose(seed), to) for to in (None, T))
    for name in ("vertices_m", "keypoints_m", "heads_m"):
        moved = getattr(here, name) @ T[:3, :3].T + T[:3, 3]
        assert np.abs(moved - getattr(there, name)).max() < 1e-5
    assert np.abs(here.normals @ T[:3, :3].T - there.normals).max() < 1e-3
    assert np.abs(T[:3, :3] @ here.rotations - there.rotations).max() < 1e-12


def test_skinning_agrees_with_its_definition():
    rng = np.random.default_rng(1)
    shape, pose = 4, random_pose(11)
    posed = pose_body(BODY, shape, pose)
    heads = BODY.heads_m[shape]
    for v in rng.integers(0, len(BODY.regions), 50):
        expected = np.zeros(3)
        for bone in BODY.skin_weights[[v]].indices:
            turned = posed.rotations[bone] @ (BODY.vertices_m[shape, v] - heads[bone])
            expected += BODY.skin_weights[v, bone] * (turned + posed.heads_m[bone])
        assert posed.vertices_m[v] == pytest.approx(expected, abs=2e-6)


def test_a_bone_takes_along_what_hangs_on_it():
    still, moved = (pose_body(BODY, 2, pose) for pose in ({}, {"lowerarm01.L": np.array([0, -np.pi / 2, 0])}))
    change = np.linalg.norm(moved.keypoints_m - still.keypoints_m, axis=1)
    assert change[[*LEFT_HAND, INDEX["left_wrist"]]].min() > 0.2
    assert change[[i for i in range(94) if i not in (INDEX["left_wrist"], INDEX["left_elbow"])]].max() < 1e-6
    # A right angle at the elbow brings the forearm forward and level; the hanging arm leans out 9 degrees.
    bones = {name: moved.heads_m[i] for i, name in enumerate(BODY.bone_names)}
    forearm = bones["wrist.L"] - bones["lowerarm01.L"]
    assert forearm / np.linalg.norm(forearm) == pytest.approx([np.cos(0.157), np.sin(0.157), 0], abs=0.01)


def test_vectors_and_matrices_pose_alike():
    vectors = {"upperarm01.R": np.array([0.3, -0.5, 0.2]), "head": np.array([0, 0.1, 0.4])}
    matrices = {bone: rotation(vector) for bone, vector in vectors.items()}
    a, b = (pose_body(BODY, 1, pose).vertices_m for pose in (vectors, matrices))
    assert np.array_equal(a, b)


def test_shapes_have_the_size_of_people():
    for i, name in enumerate(BODY.shape_names):
        stature_m = pose_body(BODY, i, {}).keypoints_m[INDEX["head_top"], 2]
        assert 1.48 < stature_m < 1.95 and abs(stature_m - traits(name)["height_m"]) < 0.025, name
        assert name.split("_")[1] == str(traits(name)["age_years"]) and 18 <= traits(name)["age_years"] < 80
        a, b, c = (BODY.vertices_m[i][BODY.triangles[:, k]].astype(float) for k in range(3))
        litres = 1000 * np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6
        assert 38 < litres < 130, (name, litres)


def test_the_mesh_is_sound():
    assert len(BODY.triangles) < 28_000
    assert np.array_equal(np.unique(BODY.triangles), np.arange(len(BODY.regions)))
    edges = np.concatenate([BODY.triangles[:, [0, 1]], BODY.triangles[:, [1, 2]], BODY.triangles[:, [2, 0]]])
    assert len(np.unique(edges, axis=0)) == len(edges), "neighbouring triangles face opposite ways"
    assert np.abs(BODY.skin_weights.sum(axis=1) - 1).max() < 1e-6


def test_normals_point_outward():
    posed = pose_body(BODY, 0, {})
    moved = posed.vertices_m + 1e-3 * posed.normals
    assert np.abs(np.linalg.norm(posed.normals, axis=1) - 1).max() < 1e-5
    a, b, c = (moved[BODY.triangles[:, k]].astype(float) for k in range(3))
    d, e, f = (posed.vertices_m[BODY.triangles[:, k]].astype(float) for k in range(3))
    grown, volume = (np.einsum("ij,ij->i", p, np.cross(q, r)).sum() for p, q, r in ((a, b, c), (d, e, f)))
    assert grown > volume


def test_regions_and_fields_agree():
    of = {name: BODY.regions == i for i, name in enumerate(REGIONS)}
    assert all(mask.any() for mask in of.values())
    arm, leg = BODY.field("arm"), BODY.field("leg")
    assert np.median(arm[of["upper_arm"]]) == pytest.approx(0.5, abs=0.25)
    assert np.median(arm[of["forearm"]]) == pytest.approx(1.5, abs=0.25)
    assert arm[of["hand"]].min() > 1.5 and arm[of["thigh"]].max() == 0
    assert np.median(leg[of["shin"]]) == pytest.approx(1.5, abs=0.25) and leg[of["foot"]].min() > 1.5
    assert BODY.field("iris_rad")[of["eye"]].max() < 1.5 and BODY.field("iris_rad")[~of["eye"]].min() > 5
    assert (BODY.field("hairline_m")[of["scalp"]] > 0).all()
    assert (BODY.field("brow_m")[of["torso"]] < 0).all() and (BODY.field("beard_m")[of["scalp"]] < 0.01).all()


def test_record_belongs_to_the_file():
    record = json.loads(BODY_FILE.with_suffix(".json").read_text())
    assert record["sha256"] == sha256_file(BODY_FILE)
    assert list(record["shapes"]) == list(BODY.shape_names)
    assert record["worst_disagreement_with_anny_mm"] <= 1
    assert (record["n_vertices"], record["n_triangles"]) == (len(BODY.regions), len(BODY.triangles))


@pytest.mark.parametrize("content", [b"", b"not a model", BODY_FILE.read_bytes()[:1000]])
def test_a_broken_file_is_refused_in_one_line(tmp_path, content):
    path = tmp_path / "body.npz"
    path.write_bytes(content)
    with pytest.raises(InputError, match="not a body model") as error:
        load_body(path)
    assert str(path) in str(error.value) and "\n" not in str(error.value)


def test_a_missing_file_is_refused():
    with pytest.raises(InputError, match="restore it"):
        load_body(Path("no-such-body.npz"))


def test_unknown_names_are_refused():
    with pytest.raises(ValueError, match="not in"):
        pose_body(BODY, "nobody", {})
    with pytest.raises(KeyError, match="tail"):
        pose_body(BODY, 0, {"tail": np.zeros(3)})


def test_the_data_page_names_the_file_by_its_hash():
    assert sha256_file(BODY_FILE) in (BODY_FILE.parent / "README.md").read_text()
