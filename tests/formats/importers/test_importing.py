"""What comes out of another tool's files is who was put in, to the format's precision."""

import json
from pathlib import Path

import numpy as np
import pytest
from native_files import (
    LAYOUTS,
    write_alphapose,
    write_coco,
    write_detectron2,
    write_mmpose,
    write_openpose,
    write_openpose_coco,
)

from hicp_lib.core.errors import InputError
from hicp_lib.core.keypoints import INDEX
from hicp_lib.evaluation.ap.evaluate import check_detections
from hicp_lib.formats.detections import read_detections, write_detections
from hicp_lib.formats.importers.importing import import_predictions, summary_lines
from tests.formats.importers.native_people import NAMES, annotated, make_person

IDS = {name: i for i, name in NAMES.items()}
WHOLE = ("coco17", "halpe26", "wholebody133", "halpe136")
HANDS_AND_FACE = [INDEX[name] for name in LAYOUTS["halpe136"][26:]]
# Format, the name of what is written, what writes it how, and the layout of its keypoints.
CASES = [
    *(("alphapose", "a/alphapose-results.json", write_alphapose, {"layout": n}, n) for n in WHOLE),
    ("alphapose", "a.json", write_alphapose, {"with_names": False}, "halpe136"),
    *(("mmpose", "predictions", write_mmpose, {"layout": n}, n) for n in WHOLE),
    ("detectron2", "coco_instances_results.json", write_detectron2, {"ids": IDS}, "coco17"),
    *(("coco", "c.json", write_coco, {"ids": IDS, "layout": n}, n) for n in WHOLE),
    *(("openpose", "o", write_openpose, {"body": n, "with_hands": False}, n) for n in ("body25", "coco18")),
    ("openpose", "o", write_openpose, {}, "body25+face+hands"),
]


def rows_of(layout: str) -> list[int]:
    if layout == "body25+face+hands":
        return sorted([INDEX[name] for name in LAYOUTS["body25"]] + HANDS_AND_FACE)
    return sorted(INDEX[name] for name in LAYOUTS[layout])


@pytest.mark.parametrize(("format", "name", "write", "how", "layout"), CASES)
def test_everybody_comes_back(tmp_path, images, found, format, name, write, how, layout):
    write(tmp_path / name, found, **how)
    imported = import_predictions(format, tmp_path / name, images)
    check_detections(imported.detections, images)
    assert list(imported.detections) == list(NAMES)
    given = rows_of(layout)
    for image_id, file_name in NAMES.items():
        people = imported.detections[image_id]
        assert len(people) == len(found[file_name]) == len(imported.extras[image_id])
        for i, person in enumerate(found[file_name]):
            xy, scores = people.keypoints_px[i], people.scores[i]
            assert np.flatnonzero(np.isfinite(xy).all(axis=-1)).tolist() == given
            assert np.allclose(xy[given], person.points_px[given], rtol=6e-6, atol=0)
            assert np.allclose(scores[given], person.scores[given], rtol=6e-6, atol=0)
            assert (np.delete(scores, given) == 0).all()
            raw = imported.extras[image_id][i]["raw_keypoint_scores"]
            assert np.allclose(raw, np.where(np.isin(range(136), given), person.scores, 0), rtol=6e-6)


@pytest.mark.parametrize(("format", "name", "write", "how", "layout"), CASES)
def test_the_written_file_is_read_by_the_library(tmp_path, images, found, format, name, write, how, layout):
    write(tmp_path / name, found, **how)
    imported = import_predictions(format, tmp_path / name, images)
    write_detections(tmp_path / "d.json", imported.detections, imported.extras)
    again = read_detections(tmp_path / "d.json", images)
    for image_id, people in imported.detections.items():
        for part in ("keypoints_px", "scores", "person_scores"):
            assert np.array_equal(getattr(again[image_id], part), getattr(people, part), equal_nan=True)
    row = json.loads((tmp_path / "d.json").read_text())[0]
    assert len(row["raw_keypoint_scores"]) == 136


def test_feet_grouped_per_foot_become_interleaved(tmp_path, images):
    person = make_person()
    for format, write in (("openpose", write_openpose), ("mmpose", write_mmpose)):
        write(tmp_path / format, {NAMES[785]: [person]})
        xy = import_predictions(format, tmp_path / format, images).detections[785].keypoints_px[0]
        # Halpe: big toes 20, 21, small toes 22, 23, heels 24, 25, left first.
        assert np.allclose(xy[20:26], person.points_px[20:26], rtol=6e-6)
    first = json.loads(next((tmp_path / "openpose").iterdir()).read_text())["people"][0]["pose_keypoints_2d"]
    small_toe = np.subtract(first[3 * 20 : 3 * 20 + 2], 0.5)  # BODY_25's 20: the left one
    assert np.allclose(small_toe, xy[22], rtol=6e-6)


def test_openpose_bodies_lie_half_a_pixel_on(tmp_path, images):
    # Found at the centre of pixel (100, 50): OpenPose writes (100.5, 50.5) for bodies, (100, 50) for hands.
    person = make_person(points_px=np.tile([100.0, 50.0], (136, 1)))
    write_openpose(tmp_path / "o", {NAMES[785]: [person]})
    written = json.loads(next((tmp_path / "o").iterdir()).read_text())["people"][0]
    assert written["pose_keypoints_2d"][:2] == [100.5, 50.5]
    assert written["hand_left_keypoints_2d"][:2] == [100.0, 50.0]
    xy = import_predictions("openpose", tmp_path / "o", images).detections[785].keypoints_px[0]
    assert (xy[np.isfinite(xy).all(axis=-1)] == [100.0, 50.0]).all()


def test_detectron2_has_its_pixel_centres_at_integers(tmp_path, images):
    # Found at the centre of pixel (100, 50): (100.5, 50.5) in Detectron2's own coordinates.
    person = make_person(points_px=np.tile([100.0, 50.0], (136, 1)))
    write_detectron2(tmp_path / "d.json", {NAMES[785]: [person]}, IDS)
    xy = import_predictions("detectron2", tmp_path / "d.json", images).detections[785].keypoints_px[0, :17]
    assert (xy == [100.0, 50.0]).all()


def test_what_openpose_did_not_find_is_absent_not_at_the_corner(tmp_path, images):
    person = make_person()
    person.scores[[INDEX["left_elbow"], INDEX["right_index_4"]]] = 0
    write_openpose(tmp_path, {NAMES[785]: [person]})
    people = import_predictions("openpose", tmp_path, images).detections[785]
    absent = [INDEX["left_elbow"], INDEX["head_top"], INDEX["right_index_4"]]
    assert sorted(np.flatnonzero(np.isnan(people.keypoints_px[0]).all(axis=-1))) == sorted(absent)
    assert (people.scores[0, absent] == 0).all()


def test_openpose_people_are_ranked_by_their_confidence_over_all_parts(tmp_path, images):
    half = make_person(scores=np.where(np.arange(136) < 17, 0.8, 0.0))
    write_openpose(tmp_path, {NAMES[785]: [half]})
    assert import_predictions("openpose", tmp_path, images).detections[785].person_scores[0] == pytest.approx(
        17 * 0.8 / 25
    )


def test_hands_alone_are_ranked_by_what_was_found(tmp_path, images):
    write_openpose(tmp_path, {NAMES[785]: [make_person(scores=np.full(136, 0.6))]})
    path = next(tmp_path.iterdir())
    data = json.loads(path.read_text())
    data["people"][0] |= {"pose_keypoints_2d": [], "face_keypoints_2d": [], "hand_right_keypoints_2d": []}
    path.write_text(json.dumps(data))
    people = import_predictions("openpose", tmp_path, images).detections[785]
    assert np.flatnonzero(np.isfinite(people.keypoints_px[0, :, 0])).tolist() == list(range(94, 115))
    assert people.person_scores.tolist() == pytest.approx([0.6])


def test_openpose_coco_json_has_flags_for_scores(tmp_path, images, found):
    found[NAMES[785]][0].scores[INDEX["nose"]] = 0
    write_openpose_coco(tmp_path / "coco.json", found)
    people = import_predictions("openpose", tmp_path / "coco.json", images).detections[785]
    assert np.isnan(people.keypoints_px[0, 0]).all() and np.isfinite(people.keypoints_px[0, 1:17]).all()
    assert people.scores[0, :17].tolist() == [0] + [1] * 16
    assert np.allclose(people.keypoints_px[1, :17], found[NAMES[785]][1].points_px[:17], rtol=1e-6)


@pytest.mark.parametrize(("highest", "scale"), [(0.98, None), (8.4, 10)], ids=["heat map", "RTMW"])
def test_mmpose_scores_keep_their_order(tmp_path, images, highest, scale):
    scores = np.linspace(0.01, highest, 136)
    write_mmpose(tmp_path, {NAMES[785]: [make_person(scores=scores, score=0.5)]}, "halpe136")
    imported = import_predictions("mmpose", tmp_path, images, scale)
    people, scale = imported.detections[785], scale or 1
    assert imported.summary["score_scale"] == scale
    assert np.allclose(people.scores[0], np.minimum(scores / scale, 1), rtol=1e-6)
    assert (np.diff(people.scores[0]) >= 0).all()
    assert np.allclose(imported.extras[785][0]["raw_keypoint_scores"], scores, rtol=1e-6)
    assert imported.summary["n_cut"] == (scores > scale).sum()
    # MMPose's own ranking: the box times the mean of scores above 0.2, in its own scale.
    assert people.person_scores[0] == pytest.approx(0.5 * scores[scores > 0.2].mean())


def test_the_scale_may_be_given(tmp_path, images):
    write_mmpose(tmp_path, {NAMES[785]: [make_person(scores=np.full(136, 1.0))]})
    imported = import_predictions("mmpose", tmp_path, images, scale=4)
    assert imported.detections[785].scores[0].max() == 0.25
    for scale in (0, -1, float("nan")):
        with pytest.raises(InputError, match="positive"):
            import_predictions("mmpose", tmp_path, images, scale=scale)


def test_mmpose_points_without_a_score_have_no_place(tmp_path, images):
    scores = np.full(136, 0.6)
    scores[[3, 100]] = 0, -0.1
    write_mmpose(tmp_path, {NAMES[785]: [make_person(scores=scores)]})
    people = import_predictions("mmpose", tmp_path, images).detections[785]
    absent = np.isnan(people.keypoints_px[0]).all(axis=-1)
    assert np.flatnonzero(absent).tolist() == [3, 17, 18, 19, 100] and (people.scores[0, absent] == 0).all()


def test_alphapose_person_scores_keep_their_scale(tmp_path, images):
    people = [make_person(1, score=2.7), make_person(2, score=0.55)]
    write_alphapose(tmp_path / "alphapose-results.json", {NAMES[785]: people})
    imported = import_predictions("alphapose", tmp_path, images)
    assert imported.detections[785].person_scores.tolist() == [2.7, 0.55]
    x, y, width, height = imported.extras[785][0]["box"]
    assert [x, y, x + width, y + height] == pytest.approx(people[0].box())
    assert imported.extras[785][0]["idx"] == [0.0]


def test_the_summary_says_what_matched(tmp_path, images, found):
    found["elsewhere.jpg"] = [make_person(4)]
    del found[NAMES[2006]]
    write_openpose(tmp_path, found)
    summary = import_predictions("openpose", tmp_path, images).summary
    assert (summary["n_images"], summary["n_with_people"], summary["n_without_people"]) == (3, 1, 1)
    assert (summary["n_not_mentioned"], summary["n_people"], summary["unmatched"]) == (1, 2, ["elsewhere"])
    assert summary["conventions"]["openpose_body25"] == 3 and summary["conventions"]["left_hand21"] == 3
    assert summary["n_outside"] == 0 and summary["n_keypoints"] == 2 * 135
    text = "\n".join(summary_lines(summary))
    assert "2 people in 1 of 3 images" in text and "elsewhere" in text and "openpose_body25 3" in text
    json.dumps(summary, allow_nan=False)


def test_keypoints_outside_the_image_are_counted(tmp_path, images):
    points = make_person().points_px.copy()
    points[:5] = [[-0.5, 0], [639.5, 479.5], [-0.6, 0], [0, 479.6], [640, 0]]
    write_mmpose(tmp_path, {NAMES[785]: [make_person(points_px=points)]}, "coco17")
    assert import_predictions("mmpose", tmp_path, images).summary["n_outside"] == 4


def test_images_are_found_by_name_in_any_folder(tmp_path):
    inside = annotated({1: "val/a.b.jpg", 2: "val/c.png"})
    found = {"a.b.jpg": [make_person(1)], "c.jpg": [make_person(2)]}
    write_alphapose(tmp_path / "a.json", found)
    write_mmpose(tmp_path / "m", found)
    write_openpose(tmp_path / "o", found)
    for format, name in (("alphapose", "a.json"), ("mmpose", "m"), ("openpose", "o")):
        people = import_predictions(format, tmp_path / name, inside).detections
        assert [len(people[i]) for i in (1, 2)] == [1, 1], format


def test_a_number_is_the_one_in_the_name_for_alphapose_and_the_id_for_coco(tmp_path):
    by_name = annotated({10: "frame_0001.png", 11: "frame_0002.png"})
    write_alphapose(tmp_path / "a.json", {"frame_0002.png": [make_person()]}, with_names=False)
    assert len(import_predictions("alphapose", tmp_path / "a.json", by_name).detections[11]) == 1
    with pytest.raises(InputError, match="none of its 1 images is annotated"):
        import_predictions("coco", tmp_path / "a.json", by_name)
    # 2 is both the number of one image and the id of another: not guessed.
    both = annotated({2: "frame_0003.png", 3: "frame_0002.png"})
    with pytest.raises(InputError, match=r"2 could be frame_0003.png and frame_0002.png"):
        import_predictions("alphapose", tmp_path / "a.json", both)


def test_two_images_of_one_name_are_not_guessed(tmp_path):
    write_mmpose(tmp_path, {"a.jpg": [make_person()]})
    with pytest.raises(InputError, match="'a' could be x/a.jpg and y/a.jpg"):
        import_predictions("mmpose", tmp_path, annotated({1: "x/a.jpg", 2: "y/a.jpg"}))


def test_one_image_under_two_names_is_refused(tmp_path):
    write_alphapose(tmp_path / "a.json", {"a.jpg": [make_person(1)], "a.png": [make_person(2)]})
    with pytest.raises(InputError, match="both belong to the image a.jpg"):
        import_predictions("alphapose", tmp_path / "a.json", annotated({1: "a.jpg"}))


def test_detectron2_without_a_registered_data_set_counts_people_as_0(tmp_path, images):
    write_detectron2(tmp_path / "d.json", {NAMES[785]: [make_person()]}, IDS)
    rows = json.loads((tmp_path / "d.json").read_text())
    (tmp_path / "d.json").write_text(json.dumps([row | {"category_id": 0} for row in rows]))
    assert len(import_predictions("detectron2", tmp_path / "d.json", images).detections[785]) == 1
    with pytest.raises(InputError, match="category_id is 0"):
        import_predictions("coco", tmp_path / "d.json", images)


def test_mmpose_without_boxes_ranks_by_keypoints(tmp_path, images):
    write_mmpose(tmp_path, {NAMES[785]: [make_person(scores=np.full(136, 0.5))]})
    path = Path(next(tmp_path.iterdir()))
    rows = json.loads(path.read_text())
    del rows[0]["bbox"], rows[0]["bbox_score"]
    path.write_text(json.dumps(rows))
    assert import_predictions("mmpose", tmp_path, images).detections[785].person_scores.tolist() == [0.5]


@pytest.mark.parametrize(("names", "told"), [("abc", "'a', 'b', 'c'"), ("abcd", "'a', 'b', 'c', ...")])
def test_of_images_that_are_not_annotated_three_are_named(names, told):
    counts = "images with_people without_people not_mentioned people cut keypoints outside passed_over"
    summary = {f"n_{count}": 0 for count in counts.split()} | {"format": "coco", "unmatched": list(names)}
    summary |= {"conventions": {}, "score_range": [0.0, 0.0, 0.0], "score_scale": 1.0, "notes": []}
    assert summary_lines(summary)[-1] == f"not annotated and left out: {len(names)} images ({told})"
