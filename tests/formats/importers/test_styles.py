"""Files in the tools' style that others write, and what tools write in other ways: read by what they say."""

import json
from dataclasses import replace

import numpy as np
import pytest
from native_files import (
    LAYOUTS,
    write_alphapose,
    write_coco,
    write_detectron2,
    write_mmpose,
    write_openpose,
)

from hicp_lib.core.detections import Detections
from hicp_lib.core.errors import InputError
from hicp_lib.core.keypoints import INDEX
from hicp_lib.formats import exporters
from hicp_lib.formats.detection_files import SUFFIXES
from hicp_lib.formats.detections import write_detections
from hicp_lib.formats.importers.importing import READERS, import_predictions, summary_lines
from tests.formats.importers.native_people import NAMES, annotated, make_person

IMAGE = NAMES[785]
HANDS = ("hand_left_keypoints_2d", "hand_right_keypoints_2d", "face_keypoints_2d")


def rewrite(path, change) -> None:
    data = json.loads(path.read_text())
    path.write_text(json.dumps(change(data) or data))


def in_openpose_style(folder, layout: str, person, **changes):
    """One person with all keypoints in the body's list, where OpenPose itself has none of that number."""
    write_openpose(folder, {IMAGE: [person]}, with_hands=False)
    (file,) = folder.iterdir()
    flat = person.triples(LAYOUTS[layout]).ravel().tolist()
    rewrite(
        file, lambda data: {**data, **changes, "people": [data["people"][0] | {"pose_keypoints_2d": flat}]}
    )
    return file


@pytest.mark.parametrize("layout", ["coco17", "halpe26", "wholebody133", "halpe136"])
def test_bodies_of_other_numbers_are_taken_as_they_are(tmp_path, images, layout):
    person = make_person()
    in_openpose_style(tmp_path, layout, person)
    people = import_predictions("openpose", tmp_path, images).detections[785]
    given = sorted(INDEX[name] for name in LAYOUTS[layout])
    assert np.flatnonzero(np.isfinite(people.keypoints_px[0, :, 0])).tolist() == given
    assert np.allclose(people.keypoints_px[0, given], person.points_px[given], rtol=6e-6)  # no half pixel
    body = [i for i in given if i < 26]
    assert people.person_scores[0] == pytest.approx(person.scores[body].mean(), rel=1e-5)


def test_hands_of_their_own_go_before_those_of_the_body(tmp_path, images):
    person = make_person()
    file = in_openpose_style(tmp_path, "halpe136", person)
    hand = replace(person, points_px=person.points_px + 7).triples(LAYOUTS["left_hand"]).ravel().tolist()
    rewrite(file, lambda data: data["people"][0].update(hand_left_keypoints_2d=hand))
    found = import_predictions("openpose", tmp_path, images).detections[785].keypoints_px[0]
    off = np.round(found - person.points_px, 2)
    assert (off[94:115] == 7).all() and (off[115:] == 0).all() and (off[:94] == 0).all()


def test_null_is_a_part_that_was_not_run(tmp_path, images):
    write_openpose(tmp_path, {IMAGE: [make_person()]})
    (file,) = tmp_path.iterdir()
    rewrite(file, lambda data: data["people"][0].update(dict.fromkeys(HANDS)))
    people = import_predictions("openpose", tmp_path, images).detections[785]
    assert np.flatnonzero(np.isfinite(people.keypoints_px[0, :, 0])).max() < 26


@pytest.mark.parametrize(
    "name", ["000000000785.json", "000000000785.jpg.json", "000000000785_keypoints.json"]
)
def test_a_file_is_named_after_its_image_in_several_ways(tmp_path, images, name):
    write_openpose(tmp_path, {IMAGE: [make_person()]})
    (file,) = tmp_path.iterdir()
    file.rename(tmp_path / name)
    (tmp_path / "._hidden.json").write_bytes(b"\x00")
    assert len(import_predictions("openpose", tmp_path, images).detections[785]) == 1


@pytest.mark.parametrize(("format", "ending"), [("openpose", "_keypoints.json"), ("mmpose", ".json")])
def test_names_with_an_underscore_first_count_and_others_are_told(tmp_path, format, ending):
    """Cameras name pictures so that are in Adobe RGB."""
    names = ["_DSC0001", "_MG_0003"]
    write = write_openpose if format == "openpose" else write_mmpose
    write(tmp_path, {f"{name}.jpg": [make_person()] for name in names})
    assert READERS[format](tmp_path).sources == names
    people = annotated({785: "_DSC0001.jpg"})
    extra = tmp_path / ("b.json" if format == "openpose" else "b.JSON")
    extra.write_text("{}")
    summary = import_predictions(format, tmp_path, people).summary
    assert summary["n_passed_over"] == 1 and summary["unmatched"] == ["_MG_0003"]
    assert summary_lines(summary)[-1] == "passed over: 1 files in JSON, not named as the others"
    extra.unlink()
    assert "passed over" not in str(summary_lines(import_predictions(format, tmp_path, people).summary))


def test_who_is_not_openpose_has_no_half_pixel(tmp_path, images):
    person = make_person()
    write_openpose(tmp_path, {IMAGE: [person]}, "coco18", with_hands=False)
    (file,) = tmp_path.iterdir()
    first = import_predictions("openpose", tmp_path, images).detections[785].keypoints_px
    rewrite(file, lambda data: data.update(version="AlphaPose v0.3"))
    second = import_predictions("openpose", tmp_path, images).detections[785].keypoints_px
    assert np.allclose((second - first)[np.isfinite(first)], 0.5)


def test_numbers_in_names_are_in_their_order(tmp_path):
    write_openpose(tmp_path, {f"shot_{i}.png": [make_person()] for i in range(12)})
    read = READERS["openpose"](tmp_path)
    assert read.sources == [f"shot_{i}" for i in range(12)]


# ---- MMPose's --save-predictions


def saved(folder, person, names, layout="coco17", **meta):
    """What the demos write: the inferencer's people beside what the model's data set is."""
    write_mmpose(folder, {IMAGE: [person]}, layout)
    (file,) = folder.iterdir()
    rows = json.loads(file.read_text())
    by_number = {str(i): name for i, name in enumerate(names)}
    info = {"dataset_name": "some", "keypoint_id2name": by_number, **meta}
    order = [LAYOUTS[layout].index(name) if name in LAYOUTS[layout] else 0 for name in names]
    for row in rows:
        for key in ("keypoints", "keypoint_scores"):
            row[key] = [row[key][i] for i in order]
    file.unlink()
    text = json.dumps({"meta_info": info, "instance_info": rows})
    (folder / f"results_{file.name}").write_text(text)


@pytest.mark.parametrize("order", ["as COCO", "backwards", "with others", "a few"])
def test_saved_predictions_are_read_by_their_names(tmp_path, images, order):
    person = make_person()
    coco = LAYOUTS["coco17"]
    names = {"as COCO": coco, "backwards": coco[::-1], "with others": [*coco, "thorax"], "a few": coco[5:11]}[
        order
    ]
    saved(tmp_path, person, names)
    people = import_predictions("mmpose", tmp_path, images).detections[785]
    given = sorted(INDEX[name] for name in names if name in INDEX)
    assert np.flatnonzero(np.isfinite(people.keypoints_px[0, :, 0])).tolist() == given
    assert np.allclose(people.keypoints_px[0, given], person.points_px[given], rtol=6e-6)
    assert np.allclose(people.scores[0, given], person.scores[given], rtol=6e-6)


def test_names_that_say_nothing_are_refused(tmp_path, images):
    saved(tmp_path, make_person(), [f"point {i}" for i in range(17)])
    with pytest.raises(InputError, match="keypoint_id2name: not understood: 'point 0'"):
        import_predictions("mmpose", tmp_path, images)


def test_another_number_than_that_of_names_is_refused(tmp_path, images):
    saved(tmp_path, make_person(), LAYOUTS["coco17"][::-1])
    (file,) = tmp_path.iterdir()
    rewrite(file, lambda data: data["instance_info"][0]["keypoint_scores"].pop() and None)
    with pytest.raises(InputError, match=r"instances\[0\]: keypoint_scores is a list of 16; expected 17"):
        import_predictions("mmpose", tmp_path, images)


# ---- nobody


@pytest.mark.parametrize("format", READERS)
def test_an_empty_list_is_nobody(tmp_path, images, format):
    file = tmp_path / ("000000000785_keypoints.json" if format == "openpose" else "000000000785.json")
    file.write_text("[]")
    imported = import_predictions(format, tmp_path if format in ("openpose", "mmpose") else file, images)
    assert [len(people) for people in imported.detections.values()] == [0, 0, 0]
    assert "0 people in 0 of 3 images" in summary_lines(imported.summary)[0]


# ---- scores


@pytest.mark.parametrize("highest", [1.0001, 1.6, 4.2, 8.4, 25])
@pytest.mark.parametrize("format", ["mmpose", "coco"])
def test_scores_above_one_have_no_scale_of_their_own(tmp_path, images, format, highest):
    person = make_person(scores=np.linspace(0.01, highest, 136))
    path = tmp_path / "p"
    write_mmpose(path, {IMAGE: [person]}) if format == "mmpose" else write_coco(
        path, {IMAGE: [person]}, {IMAGE: 785}, "halpe136"
    )
    with pytest.raises(InputError, match="give --score-scale"):
        import_predictions(format, path, images)
    found = import_predictions(format, path, images, scale=10).detections[785]
    assert found.scores.max() == pytest.approx(min(highest / 10, 1), rel=1e-3)


def test_one_scale_for_one_detector(tmp_path, images):
    """Two folders of one detector, one with low scores only, are never scaled apart."""
    scales = set()
    for k, scores in enumerate((np.full(136, 0.9), np.linspace(0.1, 4, 136))):
        write_mmpose(tmp_path / str(k), {IMAGE: [make_person(scores=scores)]})
        try:
            scales.add(import_predictions("mmpose", tmp_path / str(k), images).summary["score_scale"])
        except InputError as error:
            assert "the same for every folder of this detector" in str(error)
    assert scales == {1.0}


@pytest.mark.parametrize("format", ["openpose", "alphapose", "detectron2"])
def test_scores_far_above_one_are_not_that_tools(tmp_path, images, format):
    person = make_person(scores=np.full(136, 8.0))
    write = {"openpose": write_openpose, "alphapose": write_alphapose}.get(format)
    write(tmp_path / "p", {IMAGE: [person]}) if write else write_detectron2(
        tmp_path / "p", {IMAGE: [person]}, {IMAGE: 785}
    )
    with pytest.raises(InputError, match="give --score-scale"):
        import_predictions(format, tmp_path / "p", images)


# ---- coordinates of another size


def framed(n: int = 6):
    """Images with one annotated person each, whose keypoints a tool found exactly."""
    names = {i: f"{i}.png" for i in range(1, n + 1)}
    people = {name: [make_person(i)] for i, name in names.items()}
    images = annotated(names)
    ends = np.array([(p.points_px.min(axis=0), p.points_px.max(axis=0)) for (p,) in people.values()])
    boxes = np.concatenate([ends[:, 0], ends[:, 1] - ends[:, 0]], axis=1)
    fields = {"ids": np.arange(1, n + 1), "image_ids": np.arange(1, n + 1), "boxes_px": boxes}
    fields |= {"keypoints_px": np.full((n, 136, 2), np.nan), "visibility": np.zeros((n, 136))}
    return replace(
        images, areas_px2=boxes[:, 2] * boxes[:, 3], is_crowd=np.zeros(n, bool), extras=[{}] * n, **fields
    ), people


@pytest.mark.parametrize(
    ("scale", "refused"),
    [("0", None), ("1", "of where the annotated ones do"), ("3", "[0, 1]"), ("4", "[-1, 1]")],
)
def test_each_keypoint_scale_of_openpose(tmp_path, scale, refused):
    images, people = framed()
    change = {
        "0": lambda p: p, "1": lambda p: p * (368 / 656), "3": lambda p: p / (640, 480),
        "4": lambda p: 2 * p / (640, 480) - 1,
    }[scale]  # fmt: skip
    scaled = {n: [replace(p, points_px=change(p.points_px)) for p in found] for n, found in people.items()}
    write_openpose(tmp_path, scaled)
    if refused is None:
        import_predictions("openpose", tmp_path, images)
        return
    with pytest.raises(InputError) as error:
        import_predictions("openpose", tmp_path, images)
    assert refused in str(error.value) and "\n" not in str(error.value)


def test_few_images_or_people_seen_in_part_are_no_other_size(tmp_path):
    images, people = framed()
    upper = {
        n: [replace(p, scores=np.where(p.points_px[:, 1] < 250, p.scores, 0))] for n, (p,) in people.items()
    }
    write_openpose(tmp_path, upper)
    import_predictions("openpose", tmp_path, images)


# ---- what we write


@pytest.mark.parametrize("suffix", SUFFIXES)
@pytest.mark.parametrize("layout", exporters.LAYOUTS)
@pytest.mark.parametrize("format", exporters.FORMATS)
def test_what_is_exported_comes_back(tmp_path, images, format, layout, suffix):
    rng = np.random.default_rng(1)
    points, scores = rng.uniform(5, 400, (2, 136, 2)), rng.uniform(0.1, 1, (2, 136))
    points[1, [3, 20, 100]], scores[1, [3, 20, 100]] = np.nan, 0
    found = {785: Detections(points, scores, np.array([0.9, 0.3]))}
    if suffix == ".json":
        exporters.export_detections(format, found, tmp_path / "d.json", images, layout)
    else:
        write_detections(tmp_path / f"d{suffix}", found)
    again = import_predictions("coco", tmp_path / f"d{suffix}", images).detections[785]
    kept = sorted(INDEX[name] for name in LAYOUTS[layout if suffix == ".json" else "halpe136"])
    assert np.array_equal(again.keypoints_px[:, kept], points[:, kept], equal_nan=True)
    assert np.array_equal(again.scores[:, kept], scores[:, kept])
    assert np.array_equal(again.person_scores, found[785].person_scores)


def test_names_pair_results_with_images_whatever_their_ids_are(tmp_path):
    write_detections(
        tmp_path / "d.json", {7: Detections(np.full((1, 136, 2), 5.0), np.ones((1, 136)), np.ones(1))}
    )
    rewrite(tmp_path / "d.json", lambda rows: [row | {"file_name": "b.png"} for row in rows])
    people = import_predictions(
        "coco", tmp_path / "d.json", annotated({7: "a.png", 8: "b.png"}), 1
    ).detections
    assert [len(people[i]) for i in (7, 8)] == [0, 1]
