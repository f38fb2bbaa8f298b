"""Annotation and detection files: what is read, what is refused, and that nothing else escapes."""

import copy
import json
import math

import numpy as np
import pytest
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st

from hicp_lib.cli import main as cli
from hicp_lib.core.detections import Detections
from hicp_lib.core.errors import InputError
from hicp_lib.core.keypoints import INDEX, NAMES, TO_HALPE
from hicp_lib.datasets.subsets import SUBSETS, crop_annotations, plan
from hicp_lib.evaluation.ap.evaluate import evaluate
from hicp_lib.formats.annotations import Annotations, read_annotations, write_annotations
from hicp_lib.formats.detections import read_detections, write_detections
from hicp_lib.formats.importers.importing import import_predictions, summary_lines


def keypoints(n: int, x: float = 100.0, v: float = 2) -> list[float]:
    """n keypoints on a slanted line."""
    return [value for i in range(n) for value in (x + i, 60.0 + 2 * i, v)]


def person(i: int, image_id: int = 7, n: int = 136, **changes) -> dict:
    row = {
        "id": i, "image_id": image_id, "category_id": 1, "bbox": [90.0, 50.0, 300.0, 350.0], "area": 41_000.5,
        "iscrowd": 0, "num_keypoints": 3, "keypoints": keypoints(n),
    }  # fmt: skip
    return row | changes


def file(*people: dict) -> dict:
    return {
        "categories": [{"id": 1, "name": "person"}],
        "images": [
            {"id": 7, "file_name": "7.jpg", "width": 640, "height": 480, "license": 4},
            {"id": 9, "file_name": "val/9.jpg", "width": 640, "height": 480},
        ],
        "annotations": list(people),
    }


def result(image_id: int = 7, n: int = 136, **changes) -> dict:
    return {"image_id": image_id, "category_id": 1, "keypoints": keypoints(n, v=0.5), "score": 0.9} | changes


@pytest.fixture
def write(tmp_path):
    def write(content) -> str:
        path = tmp_path / "file.json"
        path.write_text(content if isinstance(content, str) else json.dumps(content))
        return path

    return write


# ---- what is read


def test_reads_the_quirks_of_halpe(write):
    float_flags = keypoints(136)
    float_flags[2] = 0.37  # a pseudo-label's score in place of a flag
    float_flags[5] = -1
    crowd = person(3, iscrowd=1, segmentation={"counts": [1, 2], "size": [3, 4]})
    read = read_annotations(
        write(file(person(1, keypoints=float_flags), person(2, keypoints=[0] * 408), crowd))
    )
    assert read.ids.tolist() == [1, 2, 3] and read.is_crowd.tolist() == [False, False, True]
    assert read.visibility[0, :3].tolist() == [0.37, 0.0, 2.0]
    assert np.isnan(read.keypoints_px[0, 1]).all() and read.keypoints_px[0, 2].tolist() == [102.0, 64.0]
    assert (read.visibility[1] == 0).all() and np.isnan(read.keypoints_px[1]).all()
    assert read.extras == [{}, {}, {"segmentation": {"counts": [1, 2], "size": [3, 4]}}]
    assert read.images[9].file_name == "val/9.jpg" and read.images[9].width_px == 640


@pytest.mark.parametrize(
    ("n", "convention"), [(17, "coco17"), (26, "halpe26"), (133, "wholebody133"), (136, "halpe136")]
)
def test_every_size_comes_as_halpe_136(write, n, convention):
    read = read_annotations(write(file(person(1, n=n))))
    indices = TO_HALPE[convention]
    assert np.flatnonzero(read.visibility[0] > 0).tolist() == sorted(indices.tolist())
    expected = np.array(keypoints(n)).reshape(-1, 3)[:, :2]
    assert np.array_equal(read.keypoints_px[0, indices], expected)


def test_sizes_may_differ_from_person_to_person(write):
    read = read_annotations(write(file(person(1, n=17), person(2, n=136), person(3, n=26))))
    assert (read.visibility > 0).sum(axis=1).tolist() == [17, 136, 26]


def test_wholebody_files_spread_over_five_keys(write):
    whole = keypoints(133)
    cuts = {"keypoints": (0, 51), "foot_kpts": (51, 69), "face_kpts": (69, 273), "lefthand_kpts": (273, 336),
            "righthand_kpts": (336, 399)}  # fmt: skip
    spread = person(1) | {key: whole[a:b] for key, (a, b) in cuts.items()}
    joined = read_annotations(write(file(person(1, n=133))))
    read = read_annotations(write(file(spread)))
    assert np.array_equal(read.keypoints_px, joined.keypoints_px, equal_nan=True)
    # Keys that are absent, null or empty are of parts nobody labelled.
    for key, rest in (("foot_kpts", {"face_kpts": None, "lefthand_kpts": []}), ("face_kpts", {})):
        partial = {k: of for k, of in (spread | rest).items() if k != key}
        some = read_annotations(write(file(partial, person(2, n=17))))
        gone = [k for k in cuts if not partial.get(k)]
        zeros = [0 if any(cuts[k][0] <= i < cuts[k][1] for k in gone) else x for i, x in enumerate(whole)]
        same = read_annotations(write(file(person(1, keypoints=zeros), person(2, n=17))))
        assert np.array_equal(some.keypoints_px, same.keypoints_px, equal_nan=True)
        assert (some.visibility[0, INDEX["right_hand_root"]] > 0) and (some.visibility[1] > 0).sum() == 17
    # Where the body's keypoints are not COCO's, it is told that the others are not read.
    named = file(person(1, n=16, lefthand_kpts=whole[:63]), person(2, n=16))
    named["categories"][0]["keypoints"] = [*NAMES[:15], "neck"]
    assert "of 1 people left out" in read_annotations(write(named)).notes["parts"]
    # The left small toe is WholeBody's 18, Halpe's 22.
    assert read.keypoints_px[0, INDEX["left_small_toe"]].tolist() == [118.0, 96.0]


def test_what_is_written_is_read_again(write, tmp_path):
    first = read_annotations(write(file(person(5, note="kept"), person(6, image_id=9, n=17, iscrowd=1))))
    write_annotations(tmp_path / "again.json", first)
    again = read_annotations(tmp_path / "again.json")
    assert again.images == first.images and again.extras == first.extras == [{"note": "kept"}, {}]
    for name in ("ids", "image_ids", "boxes_px", "areas_px2", "is_crowd", "keypoints_px", "visibility"):
        assert np.array_equal(getattr(again, name), getattr(first, name), equal_nan=name == "keypoints_px"), (
            name
        )
    written = json.loads((tmp_path / "again.json").read_text())
    assert [row["num_keypoints"] for row in written["annotations"]] == [17, 17]


def test_detections_are_read_in_the_order_of_the_file(write):
    truth = read_annotations(write(file(person(1))))
    lines = [result(9, score=0.1), result(7, score=-3.5), result(9, score=0.8), result(9, score=0.8, n=17)]
    found = read_detections(write(lines), truth)
    assert found[9].person_scores.tolist() == [0.1, 0.8, 0.8] and found[7].person_scores.tolist() == [-3.5]
    assert np.isnan(found[9].keypoints_px[2, 17:]).all() and (found[9].scores[2, 17:] == 0).all()
    only_one = read_detections(write(lines[:1]), truth)
    assert list(only_one) == [7, 9] and len(only_one[7]) == 0 and len(only_one[9]) == 1
    assert list(read_detections(write(lines[:1]))) == [9]


def test_people_in_fractions_among_others_are_told(tmp_path, capsys):
    truth, found = [person(i, area=41_000) for i in range(5)], [result() for _ in range(5)]
    truth[3] |= {"bbox": [0.1, 0.1, 0.5, 0.6], "keypoints": [0.5, 0.6, 2] * 136}
    found[1] |= {"keypoints": [0.5, 0.6, 0.9] * 136}
    a, d = tmp_path / "a.json", tmp_path / "d.json"
    a.write_text(json.dumps(file(*truth)))
    d.write_text(json.dumps(found))
    some = "of 1 of 5 people, first of entry {} (from 0), lie in [-1, 1]"
    given = ["--annotations", str(a), "--detections", str(d)]
    assert cli.run(["evaluate", *given, "--group", "body"]) == 0
    told = capsys.readouterr().err
    assert f"{d}: keypoints {some.format(1)}; they are read as pixels" in told
    assert f"{a}: keypoints {some.format(3)}" in told and f"; boxes {some.format(3)}" in told
    imported = import_predictions("coco", d, read_annotations(a))
    assert f"keypoints {some.format(1)}" in summary_lines(imported.summary)[-1]
    assert cli.run(["inspect", str(d)]) == 0
    assert "note: keypoints of 1 of 5 people" in capsys.readouterr().out


def test_an_empty_list_of_detections_is_nobody_found(write):
    truth = read_annotations(write(file(person(1))))
    found = read_detections(write([]), truth)
    assert list(found) == [7, 9] and not any(map(len, found.values()))
    assert read_detections(write([])) == {}


def test_the_order_is_kept_among_many(write):
    scores = np.arange(200.0)
    lines = [result(7 + 2 * (i % 2), score=score, n=17) for i, score in enumerate(scores.tolist())]
    found = read_detections(write(lines))
    assert found[7].person_scores.tolist() == scores[::2].tolist()
    assert found[9].person_scores.tolist() == scores[1::2].tolist()


def test_a_missing_keypoint_is_zeros_in_the_file_and_nan_in_memory(tmp_path):
    points, scores = np.full((1, 136, 2), np.nan), np.zeros((1, 136))
    points[0, :3], scores[0, :3] = [[0, 0], [-4.25, 1 / 3], [5, 6]], [0.5, 0.25, 0.0]
    write_detections(
        tmp_path / "d.json", {7: Detections(points, scores, np.array([0.7])), 9: Detections.none()}
    )
    row = json.loads((tmp_path / "d.json").read_text())[0]
    assert row["keypoints"][:12] == [0, 0, 0.5, -4.25, 1 / 3, 0.25, 5, 6, 0, 0, 0, 0]
    again = read_detections(tmp_path / "d.json")[7]
    assert np.array_equal(again.keypoints_px, points, equal_nan=True) and np.array_equal(again.scores, scores)


# ---- what is refused


def changed(row: dict, index: int, value) -> dict:
    row["keypoints"][index] = value
    return row


ELBOW_Y = 3 * INDEX["left_elbow"] + 1
MALFORMED_ANNOTATIONS = {
    "not an object": ([], "is not an object"),
    "no images": ({"annotations": []}, "has no 'images'"),
    "people no list": (file() | {"annotations": {}}, "annotations is an object; expected a list"),
    "person no object": (file(3), r"annotations\[0\] is 3; expected an object"),
    "same id twice": (file(person(4), person(4)), r"\[1\] \(id 4\): id is used before, by annotations\[0\]"),
    "id true": (file(person(True)), r"annotations\[0\]: id is true; expected a whole number"),
    "id too large": (file(person(2**60)), "expected a whole number"),
    "id with a fraction": (file(person(1.0)), "id is 1.0; expected a whole number"),
    "unknown image": (file(person(1, image_id=8)), r"\(id 1\): image_id 8 is not among"),
    "other category": (file(person(1, category_id=2)), "category_id is 2; expected one of 1; 1 is people"),
    "box of three": (file(person(1, bbox=[1, 2, 3])), r"a list of 3; expected \[x, y, width, height\]"),
    "negative width": (file(person(1, bbox=[1, 2, -3, 4])), "bbox has a negative width or height"),
    "text in box": (file(person(1, bbox=[1, "2", 3, 4])), r"bbox\[1\] \(y\) is the text '2'; expected"),
    "negative area": (file(person(1, area=-1)), "area is -1; expected"),
    "area a text": (file(person(1, area="5")), "area is the text '5'; expected a finite number"),
    "crowd two": (file(person(1, iscrowd=2)), "iscrowd is 2; expected 0 or 1"),
    "too few keypoints": (file(person(1, n=5)), "keypoints has 15 numbers; expected 3 per keypoint"),
    "keypoints null": (file(person(1, keypoints=None)), "keypoints is null; expected a list"),
    "NaN": (file(changed(person(1), ELBOW_Y, math.nan)), r"\(id 1\): keypoints\[22\] \(left_elbow y\) is"),
    "infinity": (file(changed(person(1), ELBOW_Y, -math.inf)), r"\(left_elbow y\) is -inf; expected"),
    "true for 1": (file(person(1), changed(person(2), 2, True)), r"\(id 2\): .*\(nose v\) is true"),
    "huge": (file(changed(person(1), 0, 10**400)), r"\(nose x\) is too large a number"),
    "NaN elsewhere": (file(person(1, note=[math.nan])), "a further key holds NaN"),
    "source a list": (file(person(1, source_image_id=[1])), "source_image_id is a list of 1; expected"),
    "source null": (file(person(1, source_image_id=None)), "source_image_id is null; expected"),
    "too short a hand": (file(person(1, n=17, lefthand_kpts=[1, 2, 2])), "lefthand_kpts is a list of 3"),
    "no list of a face": (file(person(1, n=17, face_kpts=7)), "face_kpts is 7; expected a list of 204"),
    "image id twice": (file() | {"images": 2 * file()["images"][:1]}, "id is used before, by images"),
    "image no size": (file() | {"images": [{"id": 1, "file_name": "a"}]}, r"\(id 1\): has no 'width'"),
}  # fmt: skip


@pytest.mark.parametrize("name", MALFORMED_ANNOTATIONS)
def test_malformed_annotations_are_refused_in_one_line(write, name):
    content, expected = MALFORMED_ANNOTATIONS[name]
    path = write(content)
    with pytest.raises(InputError, match=expected) as refused:
        read_annotations(path)
    message = str(refused.value)
    assert message.startswith(f"{path}: ") and "\n" not in message


@pytest.mark.parametrize(
    "name",
    [
        "",
        ".",
        "..",
        "../7.jpg",
        "a/../../7.jpg",
        "/etc/passwd",
        "C:\\7.jpg",
        "..\\7.jpg",
        "a\0b",
        "\ud800.jpg",
        7,
    ],
)
def test_file_names_cannot_lead_out_of_the_folder(write, name):
    content = file()
    content["images"][0]["file_name"] = name
    with pytest.raises(InputError, match=r"images\[0\] \(id 7\): file_name is"):
        read_annotations(write(content))


@pytest.mark.parametrize(
    ("results", "expected"),
    [
        (
            [result(), changed(result(9), ELBOW_Y, math.nan)],
            r"\(image_id 9\): keypoints\[22\] \(left_elbow y\) is nan",
        ),
        ([result(score=math.nan)], r"results\[0\] \(image_id 7\): score is nan; expected a finite number"),
        (
            [result(n=5)],
            r"\(image_id 7\): keypoints has 15 numbers; expected 3 per keypoint, of 17, 26, 133, 136",
        ),
        ([result(8)], "image_id 8 is not among the annotated images"),
        ({"annotations": []}, "results is an object; expected a list"),
        ([result(score=True)], "score is true"),
        ([result("7")], "image_id is the text '7'; expected a whole number"),
    ],
)
def test_malformed_results_are_refused_in_one_line(write, results, expected):
    truth = read_annotations(write(file(person(1))))
    with pytest.raises(InputError, match=expected) as refused:
        read_detections(write(results), truth)
    assert "\n" not in str(refused.value)


def test_files_that_are_no_json_are_refused(write, tmp_path):
    whole = json.dumps(file(person(1)))
    for content in ("", "{", whole[: len(whole) // 2], "[" * 100_000, '{"images": ' + "9" * 5000 + "}"):
        path = write(content)
        for read in (read_annotations, read_detections):
            with pytest.raises(InputError):
                read(path)
    with pytest.raises(InputError, match="cannot be read"):
        read_annotations(tmp_path / "absent.json")


# ---- nothing else escapes

JSON_VALUES = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5) | st.just(10**400)
    | st.sampled_from([0, 1, 7, -1, 2**53, 2**63, 1e308, -1e-308, 1e9, "7.jpg", "..", [], {}]),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=5), inner, max_size=3),
    max_leaves=5,
)  # fmt: skip


@st.composite
def damaged(draw, sound):
    """A sound JSON value with some entries replaced, removed or doubled."""
    value = copy.deepcopy(sound)
    for _ in range(draw(st.integers(1, 3))):
        place = value
        while True:
            keys = list(place) if isinstance(place, dict) else list(range(len(place)))
            if not keys:
                break
            key = draw(st.sampled_from(keys))
            if isinstance(place[key], dict | list) and draw(st.integers(0, 3)):
                place = place[key]
                continue
            action = draw(st.sampled_from(["replace", "remove", "double"]))
            if action == "replace":
                place[key] = draw(JSON_VALUES)
            elif action == "remove":
                del place[key]
            elif isinstance(place, list):
                place.insert(key, copy.deepcopy(place[key]))
            break
    return value


SOUND = file(person(1), person(2, n=17), person(3, image_id=9, iscrowd=1))
FUZZ = settings(
    max_examples=150,
    deadline=None,
    derandomize=True,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)


@FUZZ
@given(damaged(SOUND))
def test_damaged_annotations_are_read_or_refused_and_never_break_what_follows(tmp_path, content):
    path = tmp_path / "fuzz.json"
    path.write_text(json.dumps(content))
    try:
        people = read_annotations(path)
    except InputError as refused:
        assert "\n" not in str(refused)
        return
    write_annotations(path, people)
    assert len(read_annotations(path)) == len(people)
    table = plan(people, min_pixels=1)
    for subset in SUBSETS:
        crops = crop_annotations(people, table, subset)
        assert (~crops.is_crowd).sum() == (table[subset] == "kept").sum()
    evaluate(people, {})


@FUZZ
@given(damaged([result(), result(9, n=17), result(9, n=133, score=0.2)]))
def test_damaged_results_are_read_or_refused_and_never_evaluate_to_more_than_one(tmp_path, content):
    truth_path, path = tmp_path / "truth.json", tmp_path / "fuzz.json"
    truth_path.write_text(json.dumps(SOUND))
    truth = read_annotations(truth_path)
    path.write_text(json.dumps(content))
    try:
        found = read_detections(path, truth)
    except InputError as refused:
        assert "\n" not in str(refused)
        return
    for group in ("body", "hand"):
        figures = list(evaluate(truth, found, group).metrics().values())
        assert all(0 <= x <= 1 for x in figures)


@FUZZ
@given(st.binary(max_size=60))
def test_bytes_that_are_no_file_are_refused(tmp_path, content):
    assume(not set(content) <= set(b"[] \t\r\n"))  # an empty list is nobody
    path = tmp_path / "fuzz.json"
    path.write_bytes(content)
    for read in (read_annotations, read_detections):
        with pytest.raises(InputError):
            read(path)


def test_values_up_to_the_limits_are_read_and_none_beyond(tmp_path):
    image = {"id": 2**53, "file_name": "a.png", "width": 100_000, "height": 1}
    person = {"id": 1, "image_id": 2**53, "bbox": [-1e9, 0, 1e9, 0], "area": 0, "keypoints": [1e9, 0, 1] * 17}
    fine = {"images": [image], "annotations": [person]}
    wrong = {
        "id is 9007199254740993": {"images": [image | {"id": 2**53 + 1}], "annotations": []},
        "width is 100001; expected 1 to 100000": {"images": [image | {"width": 100_001}], "annotations": []},
        "height is 0; expected 1 to 100000": {"images": [image | {"height": 0}], "annotations": []},
        r"bbox\[2\] \(width\)": {"images": [image], "annotations": [person | {"bbox": [0, 0, 1.1e9, 0]}]},
        "negative width": {"images": [image], "annotations": [person | {"bbox": [0, 0, 1, -0.1]}]},
        "area is -1": {"images": [image], "annotations": [person | {"area": -1}]},
    }
    path = tmp_path / "a.json"
    path.write_text(json.dumps(fine))
    assert read_annotations(path).boxes_px.tolist() == [[-1e9, 0, 1e9, 0]]
    for message, data in wrong.items():
        path.write_text(json.dumps(data))
        with pytest.raises(InputError, match=message):
            read_annotations(path)


def test_of_nobody_nobody_is_another():
    people = Annotations.concatenate([], {})
    assert people.is_other.dtype == bool and len(people.is_other) == 0
