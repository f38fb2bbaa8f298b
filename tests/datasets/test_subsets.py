"""Basic and Headless: crops, cuts, counts, pixels and what happens when writing is interrupted."""

import json
import os
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from hicp_lib.core.errors import InputError
from hicp_lib.core.images import read_image
from hicp_lib.core.keypoints import BODY, FACE, HANDS, HEAD, INDEX
from hicp_lib.datasets import subsets as hicp_dataset
from hicp_lib.datasets.crops import crop_people, inside, n_pixels, whole_pixel_boxes
from hicp_lib.datasets.heads import headless_cut
from hicp_lib.datasets.subsets import SUBSETS, count_sensitivity, create_hicp, crop_annotations, notes, plan
from hicp_lib.evaluation.ap.evaluate import evaluate
from hicp_lib.formats.annotations import Annotations, ImageInfo, read_annotations, write_annotations

TRUNK = np.setdiff1d(BODY, HEAD)


def upright(seed: int = 0) -> np.ndarray:
    """Somebody standing: head around (100, 40), the rest around (100, 180); shape (136, 2)."""
    rng = np.random.default_rng(seed)
    points = np.array([100.0, 180.0]) + rng.uniform(-40, 40, (136, 2))
    points[HEAD] = np.array([100.0, 40.0]) + rng.uniform(-15, 15, (len(HEAD), 2))
    return points


def people(keypoints_px, boxes_px, image_ids=None, visibility=None, crowd=(), size=(640, 480)) -> Annotations:
    n = len(boxes_px)
    image_ids = np.array([5] * n if image_ids is None else image_ids)
    visibility = np.full((n, 136), 2.0) if visibility is None else visibility
    return Annotations(
        {int(i): ImageInfo(int(i), f"{i}.jpg", *size) for i in sorted(set(image_ids))},
        np.arange(n) + 11, image_ids, np.array(boxes_px, dtype=float), np.full(n, 9000.0),
        np.isin(np.arange(n), crowd), np.where(visibility[..., None] > 0, keypoints_px, np.nan), visibility,
        [{} for _ in range(n)],
    )  # fmt: skip


# ---- geometry


def test_boxes_are_rounded_outwards_and_clipped():
    boxes = np.array(
        [[1.2, 2.0, 3.0, 4.5], [-5, -5, 700, 20], [630.5, 470.5, 50, 50], [700, 10, 5, 5], [1.5, 0, 0, 9]]
    )
    whole = whole_pixel_boxes(boxes, np.full(5, 640), np.full(5, 480))
    assert whole[:3].tolist() == [[1, 2, 5, 7], [0, 0, 640, 15], [630, 470, 640, 480]]
    assert [n_pixels(box) for box in whole] == [20, 9600, 100, 0, 0]


def test_a_keypoint_belongs_to_the_pixel_whose_centre_is_nearest():
    points = np.array([[9.49, 20], [9.5, 20], [19.49, 29.49], [19.5, 29], [np.nan, 20]])
    assert inside(points, (10, 20, 20, 30)).tolist() == [False, True, True, False, False]


@pytest.mark.parametrize(("turned", "side"), [(0, "top"), (90, "right"), (180, "bottom"), (270, "left")])
def test_the_head_is_cut_off_at_its_side(turned, side):
    angle = np.deg2rad(turned)
    rotation = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]).round()
    points = (upright() - 150) @ rotation.T + 150
    cut = headless_cut(points, np.ones(136), (0, 0, 300, 300))
    assert cut.side == side
    assert np.allclose(cut.head_px, points[HEAD].mean(axis=0)) and np.allclose(
        cut.body_px, points[TRUNK].mean(axis=0)
    )
    assert not inside(points[HEAD], cut.kept_px).any()
    assert inside(points[TRUNK], cut.kept_px).all()
    # Tight: one pixel more, and a head keypoint would be back.
    axis, end = {"left": (0, 0), "top": (1, 1), "right": (0, 2), "bottom": (1, 3)}[side]
    wider = list(cut.kept_px)
    wider[end] += 1 if end >= 2 else -1
    assert inside(points[HEAD], wider).any(), axis


@settings(max_examples=150, deadline=None, derandomize=True)
@given(
    arrays(
        float,
        (136, 2),
        elements=st.floats(-20, 220) | st.sampled_from([0.0, 49.5, 50.0, 199.5]),
        fill=st.nothing(),
    ),
    arrays(np.int8, 136, elements=st.sampled_from([0, 2])),
    st.tuples(st.integers(0, 50), st.integers(0, 50), st.integers(51, 200), st.integers(51, 200)),
)
def test_no_head_keypoint_ever_stays(points, visibility, crop):
    cut = headless_cut(points, visibility, crop)
    labelled = (visibility > 0) & inside(points, crop)
    if cut is None:
        assert not labelled[HEAD].any() or not labelled[TRUNK].any()
        return
    assert not (inside(points[HEAD], cut.kept_px) & labelled[HEAD]).any()
    moved = [i for i in range(4) if cut.kept_px[i] != crop[i]]
    assert moved == [("left", "top", "right", "bottom").index(cut.side)]
    away = cut.head_px - cut.body_px
    assert (np.argmax(np.abs(away)) == (cut.side in ("top", "bottom"))) or abs(away[0]) == abs(away[1])


def test_an_unlabelled_face_is_assumed_as_long_as_the_skull():
    points, visibility = upright(), np.ones(136)
    points[INDEX["head_top"]] = [100, 20]
    points[:5] = [100, 40]
    visibility[FACE] = 0
    assert headless_cut(points, visibility, (0, 0, 300, 300)).kept_px == (0, 61, 300, 300)  # chin at 60
    visibility[FACE] = 1
    labelled_chin = headless_cut(points, visibility, (0, 0, 300, 300)).kept_px
    assert labelled_chin[1] == np.floor(points[FACE, 1].max() + 0.5) + 1


# What a data set labels of head and trunk -> the rule, and where the face ends.
FEW_LABELS = {
    ("head_top", "neck"): ("neck", 90),
    ("head_top", "left_shoulder", "right_shoulder"): ("shoulders", 92.7),
    ("nose", "left_eye", "right_eye", "neck"): ("neck", 85),
    ("nose", "left_eye", "right_eye", "right_shoulder"): ("shoulders", 89.5),
    ("left_ear", "neck", "left_hip"): ("neck", 85),
    ("face_30", "neck"): ("neck", 85),
    ("head_top", "left_ear", "neck"): ("head top", 80),
    ("face_8", "neck"): ("chin labelled", 75),
    ("nose", "left_hip"): ("head labels only", 40),
}


@pytest.mark.parametrize("names", FEW_LABELS)
@pytest.mark.parametrize("turned", [0, 1, 2, 3])
def test_with_few_labels_the_face_ends_on_the_way_to_the_neck(names, turned):
    points = np.full((136, 2), 200.0)
    ys = {
        "head_top": 0,
        "neck": 100,
        "left_shoulder": 100,
        "right_shoulder": 106,
        "face_8": 75,
        "left_hip": 190,
    }
    for name in names:
        points[INDEX[name], 1] = ys.get(name, 40)
    labelled = np.isin(np.arange(136), [INDEX[name] for name in names])
    rule, end = FEW_LABELS[names]
    for _ in range(turned):
        points = np.stack([200 - points[:, 1], points[:, 0]], axis=-1)
    cut = headless_cut(points, labelled * 2.0, (-300, -300, 300, 300))
    assert cut.rule == rule
    edge = {
        "top": cut.kept_px[1],
        "bottom": 200 - cut.kept_px[3],
        "left": cut.kept_px[0],
        "right": 200 - cut.kept_px[2],
    }
    assert -0.5 <= edge[cut.side] - end <= 1.5  # to whole pixels


def test_hands_and_the_parts_outside_do_not_move_the_body():
    points = upright()
    crop = (0, 0, 300, 300)
    body = headless_cut(points, np.ones(136), crop).body_px
    points[HANDS] = [10, 290]
    assert np.array_equal(headless_cut(points, np.ones(136), crop).body_px, body)
    points[INDEX["left_ankle"]] = [100, 1000]  # below the crop: as if not labelled
    rest = np.setdiff1d(TRUNK, [INDEX["left_ankle"]])
    assert np.allclose(headless_cut(points, np.ones(136), crop).body_px, points[rest].mean(axis=0))


# ---- plan: who is kept


def test_crops_need_twenty_thousand_pixels():
    table = plan(people([upright()] * 3, [[0, 0, 100, 200], [0, 0, 100, 199], [0, 0, 99.5, 199.5]]))
    assert table["basic"].tolist() == ["kept", "too small", "kept"]  # 99.5 x 199.5 covers 100 x 200 pixels
    assert plan(people([upright()], [[0, 0, 100, 199]]), min_pixels=19_900)["basic"].item() == "kept"


@pytest.mark.parametrize("fraction", [0, 0.2, 0.5, 0.7, 1])
def test_every_keypoint_in_a_box_around_them_is_kept(fraction):
    points = np.floor(upright()) + fraction
    for low in (points.min(axis=0), [0.0, 0.0]):  # within the image, and the whole image to its edges
        shifted = points - points.min(axis=0) + low
        high = shifted.max(axis=0)
        size = [640, 480] if low[0] else np.ceil(high).astype(int).tolist()
        annotations = people([shifted], [[*low, *(high - low)]], size=size)
        table = plan(annotations, min_pixels=1)
        crop = crop_annotations(annotations, table, "basic")
        assert (crop.visibility[0] > 0).all()
        image = crop.images[11]
        assert inside(crop.keypoints_px[0], (0, 0, image.width_px, image.height_px)).all()


def test_a_crop_grows_by_no_more_than_the_keypoints_need():
    points = np.array([[50.7, 80.2]] * 136)
    points[:2] = [[100.6, 60], [140, 60]]  # at the box's right edge; well outside
    row = plan(people([points], [[20.3, 10.2, 80.4, 100]]), min_pixels=1).iloc[0]
    assert [row[f"basic_crop_{edge}_px"] for edge in ("left", "top", "right", "bottom")] == [20, 10, 102, 111]


def test_headless_needs_its_pixels_only_when_told_so():
    annotations = people([upright()] * 2, [[50, 0, 100, 200], [0, 0, 200, 300]])
    assert plan(annotations)["headless"].tolist() == ["kept", "kept"]
    assert plan(annotations, headless_min_pixels=20_000)["headless"].tolist() == ["too small", "kept"]


def test_every_reason_is_named():
    visibility = np.full((6, 136), 2.0)
    visibility[1] = 0
    visibility[2, HEAD] = 0
    visibility[3, TRUNK] = 0
    boxes = [[0, 0, 200, 300]] * 5 + [[900, 0, 200, 300]]
    table = plan(people([upright()] * 6, boxes, visibility=visibility, crowd=[4]))
    assert table["basic"].tolist() == ["kept", "no keypoints", "kept", "kept", "crowd", "too small"]
    assert table["headless"].tolist() == [
        "kept", "not in Basic", "no head labelled", "no body labelled", "not in Basic", "not in Basic",
    ]  # fmt: skip
    counts = hicp_dataset.summary(table)
    assert counts["people"] == sum(counts["basic"].values()) == sum(counts["headless"].values()) == 6
    assert counts["basic"]["kept"] == 3 and counts["headless"]["kept"] == 1


def test_the_plan_has_what_the_figure_draws():
    points = upright()
    row = plan(people([points], [[0, 0, 200, 300]])).iloc[0]
    edges = ("left", "top", "right", "bottom")
    for part, of_it in (("head", HEAD), ("body", TRUNK)):
        extent = [*points[of_it].min(axis=0), *points[of_it].max(axis=0)]
        assert [row[f"{part}_{edge}_px"] for edge in edges] == pytest.approx(extent)
        assert [row[f"{part}_{axis}_px"] for axis in "uv"] == pytest.approx(points[of_it].mean(axis=0))
    assert (
        row["cut_side"] == "top" and row["headless_crop_top_px"] == np.floor(points[HEAD, 1].max() + 0.5) + 1
    )


def test_sensitivity_counts_move_with_the_rules():
    visibility = np.full((4, 136), 2.0)
    visibility[1] = 0
    visibility[2, HEAD] = 0
    boxes = [[50, 0, 100, 200], [0, 0, 200, 300], [0, 0, 200, 300], [50, 0, 60, 170]]
    table = count_sensitivity(people([upright()] * 4, boxes, visibility=visibility))
    assert table["basic"].tolist() == [2, 2, 3, 1, 3]
    assert table["headless"].tolist() == [1, 0, 2, 0, 3]


# ---- annotations of the crops


def test_keypoints_boxes_and_areas_move_into_the_crop():
    annotations = people([upright()], [[90.5, 10, 90, 250]])
    moved = crop_people(annotations, np.array([0]), (90, 10, 181, 260))
    stays = inside(annotations.keypoints_px[0], (90, 10, 181, 260))
    assert 0 < stays.sum() < 136
    assert np.array_equal(moved.keypoints_px[0, stays], annotations.keypoints_px[0, stays] - [90, 10])
    assert np.isnan(moved.keypoints_px[0, ~stays]).all() and (moved.visibility[0, ~stays] == 0).all()
    assert moved.boxes_px.tolist() == [[0.5, 0, 90, 250]] and moved.areas_px2.tolist() == [9000]
    half = crop_people(annotations, np.array([0]), (90, 135, 181, 260))
    assert half.areas_px2.tolist() == [4500] and half.boxes_px.tolist() == [[0.5, 0, 90, 125]]


def test_the_area_of_a_person_cut_off_by_the_image_is_whole_in_basic():
    annotations = people([upright()], [[-50, -20, 250, 320]])
    basic = crop_annotations(annotations, plan(annotations), "basic")
    assert basic.areas_px2.tolist() == [9000] and basic.boxes_px.tolist() == [[0, 0, 200, 300]]


def test_others_in_the_crop_are_kept_aside():
    far = upright() + [400, 0]
    annotations = people(
        [upright(), upright() + [60, 0], far], [[0, 0, 200, 300], [60, 0, 200, 300], [400, 0, 200, 300]]
    )
    basic = crop_annotations(annotations, plan(annotations), "basic")
    assert list(basic.images) == [11, 12, 13] and basic.image_ids.tolist() == [11, 11, 12, 12, 13]
    assert basic.ids.tolist() == [11, 14, 12, 15, 13]
    assert basic.is_crowd.tolist() == [False, True, False, True, False]
    assert basic.extras[1] == {"other": True, "source_id": 12}
    source = {"source_id": 11, "source_image_id": 5, "source_file": "5.jpg", "source_area": 9000.0}
    assert basic.extras[0] == {"subset": "basic", **source, "crop_px": [0, 0, 200, 300]}
    assert basic.boxes_px[1].tolist() == [60, 0, 140, 300] and basic.areas_px2[1] == pytest.approx(9000 * 0.7)
    headless = crop_annotations(annotations, plan(annotations), "headless")
    assert headless.extras[0]["cut_side"] == "top" and headless.extras[0]["source_area"] == 9000
    assert evaluate(headless, {}, area="source").n_people == 3


# ---- writing


@pytest.fixture
def source(tmp_path):
    """Two images with three people, one image as lossy JPEG; returns the folder."""
    rng = np.random.default_rng(0)
    folder = tmp_path / "source"
    (folder / "images").mkdir(parents=True)
    for i in (5, 6):
        noise = cv2.resize(rng.integers(0, 255, (48, 64, 3), dtype=np.uint8), (640, 480))
        cv2.imwrite(str(folder / "images" / f"{i}.jpg"), noise)
    points = [upright(0), upright(1) + [300, 20], upright(2) + [200, 100]]
    boxes = [[20.3, 5, 170, 240], [320, 10, 180.5, 260], [210, 100, 200, 250]]
    write_annotations(folder / "annotations.json", people(points, boxes, [5, 5, 6]))
    return folder


def create(source: Path, out: Path, **options) -> dict:
    return create_hicp(source / "annotations.json", source / "images", out, **options)


def contents(folder: Path) -> dict[str, bytes]:
    return {str(p.relative_to(folder)): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}


def test_crops_keep_the_original_pixels_and_keypoints_stay_on_theirs(source, tmp_path):
    counts = create(source, tmp_path / "hicp")
    assert counts["basic"]["kept"] == counts["headless"]["kept"] == 3
    truth = read_annotations(source / "annotations.json")
    for subset in SUBSETS:
        crops = read_annotations(tmp_path / "hicp" / subset / "annotations.json")
        mains = crops.take(~crops.is_crowd)
        assert mains.ids.tolist() == truth.ids.tolist()
        for i, extra in enumerate(mains.extras):
            image = crops.images[int(mains.image_ids[i])]
            written = read_image(tmp_path / "hicp" / subset / "images" / image.file_name)
            original = read_image(source / "images" / extra["source_file"])
            left, top, right, bottom = extra["crop_px"]
            assert written.shape == (image.height_px, image.width_px, 3) == (bottom - top, right - left, 3)
            assert np.array_equal(written, original[top:bottom, left:right])
            given = mains.visibility[i] > 0
            assert np.array_equal(mains.keypoints_px[i, given] + [left, top], truth.keypoints_px[i, given])
            assert not given[HEAD].any() if subset == "headless" else given[HEAD].all()


def test_a_second_call_writes_no_crop_and_changes_nothing(source, tmp_path, monkeypatch):
    create(source, tmp_path / "hicp")
    before = contents(tmp_path / "hicp")
    monkeypatch.setattr(hicp_dataset, "write_png", lambda *_: pytest.fail("a crop was written again"))
    create(source, tmp_path / "hicp")
    assert contents(tmp_path / "hicp") == before


def test_goes_on_after_an_interruption(source, tmp_path, monkeypatch):
    create(source, tmp_path / "whole")
    out, write, written = tmp_path / "hicp", hicp_dataset.write_png, []

    def write_two(path, pixels):
        if len(written) == 2:
            raise KeyboardInterrupt
        written.append(path)
        write(path, pixels)

    monkeypatch.setattr(hicp_dataset, "write_png", write_two)
    with pytest.raises(KeyboardInterrupt):
        create(source, out)
    assert not list(out.rglob("annotations.json")) and not (out / "summary.json").exists()
    written.clear()
    monkeypatch.setattr(
        hicp_dataset, "write_png", lambda path, pixels: (written.append(path), write(path, pixels))
    )
    create(source, out)
    assert len(written) == 4
    assert contents(out) == contents(tmp_path / "whole")


def test_other_rules_replace_the_crops(source, tmp_path):
    out = tmp_path / "hicp"
    create(source, out)
    create(source, out, min_pixels=45_000)
    assert [p.name for p in sorted((out / "basic" / "images").iterdir())] == [
        "000000000012.png",
        "000000000013.png",
    ]


def test_a_changed_image_replaces_the_crops(source, tmp_path):
    image, pixels = source / "images" / "6.jpg", read_image(source / "images" / "6.jpg")
    for number, content in enumerate((pixels, 255 - pixels)):
        image.write_bytes(cv2.imencode(".bmp", content)[1].tobytes())  # equal in size
        os.utime(image, (number, number))
        create(source, tmp_path / "hicp")
    crop = read_image(tmp_path / "hicp" / "basic" / "images" / "000000000013.png")
    assert np.array_equal(crop, (255 - pixels)[..., ::-1][100:350, 210:410])


def test_summary_is_written(source, tmp_path):
    counts = create(source, tmp_path / "hicp", min_pixels=45_000, headless_min_pixels=45_000)
    assert json.loads((tmp_path / "hicp" / "summary.json").read_text()) == counts
    assert counts["people"] == 3 and counts["basic"] == {"kept": 2, "too small": 1}
    assert counts["headless"] == {"kept": 0, "too small": 2, "not in Basic": 1}


def test_what_is_wrong_with_the_images_is_said(source, tmp_path):
    image = source / "images" / "5.jpg"
    cv2.imwrite(str(image), np.zeros((100, 200, 3), np.uint8))
    with pytest.raises(InputError, match="5.jpg: is 200x100 pixels, annotated as 640x480"):
        create(source, tmp_path / "hicp")
    image.write_bytes(b"no image")
    with pytest.raises(InputError, match="5.jpg: is not an image"):
        create(source, tmp_path / "hicp")
    image.unlink()
    with pytest.raises(InputError, match="5.jpg: cannot be read .*images' folder"):
        create(source, tmp_path / "hicp")
    assert not list((tmp_path / "hicp").rglob("annotations.json"))


def test_a_folder_of_something_else_is_left_alone(source, tmp_path):
    mine = tmp_path / "hicp" / "basic" / "thesis.txt"
    mine.parent.mkdir(parents=True)
    mine.write_text("precious")
    with pytest.raises(InputError, match="holds files not made by this command"):
        create(source, tmp_path / "hicp")
    assert mine.read_text() == "precious" and len(list((tmp_path / "hicp").rglob("*"))) == 2


def test_files_of_others_stay_beside_the_crops(source, tmp_path):
    out = tmp_path / "hicp"
    create(source, out)
    mine = out / "basic" / "images" / "mine.png"
    mine.write_text("precious")
    marker = json.loads((out / "crops.json").read_text())
    (out / "crops.json").write_text(json.dumps({**marker, "names": ["../stays.txt", *marker["names"]]}))
    (tmp_path / "stays.txt").write_text("precious")
    n_before = len(list((out / "basic" / "images").iterdir()))
    create(source, out, min_pixels=45_000)
    assert mine.exists() and (tmp_path / "stays.txt").exists()
    assert len(list((out / "basic" / "images").iterdir())) == 3 < n_before
    gone = next(name for name in marker["names"] if "basic/images" in name and not (out / name).exists())
    (out / gone).write_text("precious")
    with pytest.raises(InputError, match="was not made by this command"):
        create(source, out)


@pytest.mark.parametrize("n_bytes", [0, 100])
def test_crops_that_are_not_whole_are_cut_again(source, tmp_path, n_bytes):
    create(source, tmp_path / "hicp")
    crop = tmp_path / "hicp" / "basic" / "images" / "000000000013.png"
    whole = crop.read_bytes()
    crop.write_bytes(whole[:n_bytes])
    create(source, tmp_path / "hicp")
    assert crop.read_bytes() == whole


@pytest.mark.parametrize("out", [".", "images", "images/.."])
def test_a_folder_that_holds_what_is_read_is_not_written_to(source, out):
    before = {path: path.read_bytes() for path in source.rglob("*") if path.is_file()}
    with pytest.raises(InputError, match="which is read; give another folder"):
        create(source, source / out)
    assert {path: path.read_bytes() for path in source.rglob("*") if path.is_file()} == before


def test_nobody_annotated_gives_empty_datasets(source, tmp_path):
    write_annotations(
        source / "annotations.json", people(np.zeros((0, 136, 2)), np.zeros((0, 4)), [], np.zeros((0, 136)))
    )
    counts = create(source, tmp_path / "hicp")
    assert [counts[key] for key in ("people", *SUBSETS)] == [0, {"kept": 0}, {"kept": 0}]
    assert notes(counts) == []
    assert len(read_annotations(tmp_path / "hicp" / "headless" / "annotations.json")) == 0


@pytest.mark.skipif(
    "HICP_HALPE" not in os.environ, reason="HICP_HALPE names no folder of real Halpe annotations"
)
def test_real_halpe_annotations(tmp_path):
    folder = Path(os.environ["HICP_HALPE"])
    truth = read_annotations(folder / "annotations.json")
    counts = create(folder, tmp_path)
    assert counts["people"] == len(truth) and counts["basic"]["kept"] > 0
    headless = read_annotations(tmp_path / "headless" / "annotations.json")
    assert not (headless.visibility[~headless.is_crowd][:, HEAD] > 0).any()
