"""What is exported, read by others: pycocotools, and our own reader."""

import contextlib
import io
import json

import numpy as np
import pytest
from pycocotools.coco import COCO

from hicp_lib.cli import main as cli
from hicp_lib.core.detections import Detections
from hicp_lib.core.errors import InputError
from hicp_lib.core.keypoints import INDEX, N_KEYPOINTS, NAMES, TO_HALPE
from hicp_lib.formats.annotations import Annotations, ImageInfo, read_annotations
from hicp_lib.formats.detections import read_detections, write_detections
from hicp_lib.formats.exporters import LAYOUTS, export_detections


@pytest.fixture
def images() -> Annotations:
    infos = {i: ImageInfo(i, f"{i}.png", 640, 480) for i in (7, 9, 11)}
    none = np.zeros(0, dtype=int)
    return Annotations(infos, none, none, np.zeros((0, 4)), np.zeros(0), none.astype(bool),
                       np.zeros((0, 136, 2)), np.zeros((0, 136)), [])  # fmt: skip


@pytest.fixture
def found() -> dict[int, Detections]:
    """Two people in image 7, the second with a left hand only; nobody in 9; one person in 11."""
    rng = np.random.default_rng(0)
    points, scores = rng.uniform(0, 400, (3, N_KEYPOINTS, 2)), rng.uniform(0.1, 1, (3, N_KEYPOINTS))
    points[0, INDEX["left_knee"]] = np.nan
    points[1, :94], points[1, 115:] = np.nan, np.nan
    scores[np.isnan(points).any(axis=-1)] = 0
    none = Detections.none()
    return {7: Detections(points[:2], scores[:2], np.array([0.9, -3.5])), 9: none,
            11: Detections(points[2:], scores[2:], np.array([2.5]))}  # fmt: skip


@pytest.mark.parametrize("layout", LAYOUTS)
def test_results_come_back_in_every_layout(tmp_path, images, found, layout):
    n = export_detections("coco", found, tmp_path / "d.json", layout=layout)
    again = read_detections(tmp_path / "d.json", images)
    kept = TO_HALPE[layout]
    # The second person has a hand only: nothing of it is in layouts without hands.
    assert n == (3 if layout in ("halpe136", "wholebody133") else 2)
    for image_id, rows in ((7, [0, 1][: n - 1]), (11, [0])):
        points = np.full((len(rows), N_KEYPOINTS, 2), np.nan)
        points[:, kept] = found[image_id].keypoints_px[rows][:, kept]
        assert np.array_equal(again[image_id].keypoints_px, points, equal_nan=True)
        assert np.array_equal(again[image_id].scores[:, kept], found[image_id].scores[rows][:, kept])
        assert np.array_equal(again[image_id].person_scores, found[image_id].person_scores[rows])


@pytest.mark.parametrize("layout", LAYOUTS)
def test_the_fiftyone_data_set_is_a_coco_data_set(tmp_path, images, found, layout):
    n = export_detections("fiftyone", found, tmp_path / "d.json", images, layout)
    with contextlib.redirect_stdout(io.StringIO()):
        coco = COCO(tmp_path / "d.json")
    assert coco.getImgIds() == [7, 9, 11] and coco.imgs[9]["file_name"] == "9.png"
    assert coco.getAnnIds() == list(range(1, n + 1))
    category = coco.cats[1]
    assert category["keypoints"] == [NAMES[i] for i in TO_HALPE[layout]]
    limbs = {tuple(category["keypoints"][k - 1] for k in limb) for limb in category["skeleton"]}
    assert ("left_elbow", "left_wrist") in limbs
    assert (("left_hand_root", "left_thumb_1") in limbs) == (layout in ("halpe136", "wholebody133"))
    person = coco.anns[1]
    triples = np.reshape(person["keypoints"], (-1, 3))
    assert triples[TO_HALPE[layout].tolist().index(INDEX["left_knee"])].tolist() == [0, 0, 0]
    assert person["num_keypoints"] == (triples[:, 2] == 2).sum() == len(triples) - 1
    x, y, width, height = person["bbox"]
    inside = triples[triples[:, 2] > 0, :2]
    assert ([x, y] == inside.min(axis=0)).all()
    assert np.allclose([x + width, y + height], inside.max(axis=0))
    assert person["confidence"] == found[7].scores[0, TO_HALPE[layout]].tolist() and person["score"] == 0.9


def test_our_own_reader_takes_the_data_set_for_annotations(tmp_path, images, found):
    export_detections("fiftyone", found, tmp_path / "d.json", images)
    again = read_annotations(tmp_path / "d.json")
    assert np.array_equal(again.keypoints_px[:2], found[7].keypoints_px, equal_nan=True)


@pytest.mark.parametrize("suffix", [".json", ".csv", ".parquet"])
def test_results_keep_the_names_of_their_images(tmp_path, images, found, suffix):
    names, out = {7: "11.png", 9: "9.png", 11: "7.png"}, str(tmp_path / "e.json")
    facts = {i: [{"file_name": names[i], "frame": i, "time_s": i / 4}] * len(of) for i, of in found.items()}
    write_detections(tmp_path / f"d{suffix}", found, facts)
    given = ["--detections", str(tmp_path / f"d{suffix}"), "--format", "coco"]
    assert cli.run(["export", *given, "--out", out]) == 0
    rows = json.loads((tmp_path / "e.json").read_text())
    assert [(row["file_name"], row["frame"], row["time_s"]) for row in rows] == [
        ("11.png", 7, 1.75), ("11.png", 7, 1.75), ("7.png", 11, 2.75),
    ]  # fmt: skip
    assert [len(of) for of in read_detections(tmp_path / "e.json", images).values()] == [1, 0, 2]


def test_nobody_is_an_empty_list(tmp_path):
    assert export_detections("coco", {7: Detections.none()}, tmp_path / "d.json") == 0
    assert json.loads((tmp_path / "d.json").read_text()) == []


def test_what_cannot_be_exported(tmp_path, images, found):
    out = tmp_path / "d.json"
    with pytest.raises(InputError, match="format 'yolo'.*coco, fiftyone"):
        export_detections("yolo", found, out)
    with pytest.raises(InputError, match="layout 'body25'.*coco17"):
        export_detections("coco", found, out, layout="body25")
    with pytest.raises(InputError, match="needs the annotations"):
        export_detections("fiftyone", found, out)
    with pytest.raises(InputError, match="image 8: not among"):
        export_detections("fiftyone", {8: found[9]}, out, images)
    with pytest.raises(InputError, match="d.csv: ends in '.csv'; expected .json"):
        export_detections("coco", found, tmp_path / "d.csv")
    assert not out.exists()


def test_a_person_of_the_fiftyone_data_set_is_as_large_as_what_was_given_of_them(tmp_path, images):
    points, scores = np.full((1, N_KEYPOINTS, 2), np.nan), np.zeros((1, N_KEYPOINTS))
    points[0, :3], scores[0, :3] = [[10, 20], [30, 25], [14, 60]], [0.5, 0.25, 1.0]
    found = {7: Detections(points, scores, np.array([0.75]))}
    export_detections("fiftyone", found, tmp_path / "d.json", images, "coco17")
    (person,) = json.loads((tmp_path / "d.json").read_text())["annotations"]
    assert person["bbox"] == [10, 20, 20, 40] and person["area"] == 800
    assert person["keypoints"] == [10, 20, 2, 30, 25, 2, 14, 60, 2, *[0] * 42]
    assert person["confidence"] == [0.5, 0.25, 1.0, *[0] * 14]
    assert (person["id"], person["iscrowd"], person["num_keypoints"], person["score"]) == (1, 0, 3, 0.75)
