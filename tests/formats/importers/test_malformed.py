"""Native files that are not as expected: one line says where and what; nothing but InputError escapes."""

import copy
import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from native_files import (
    write_alphapose,
    write_coco,
    write_detectron2,
    write_mmpose,
    write_openpose,
    write_openpose_coco,
)

from hicp_lib.core.errors import InputError
from hicp_lib.evaluation.ap.evaluate import check_detections
from hicp_lib.formats.detections import write_detections
from hicp_lib.formats.importers.importing import import_predictions, summary_lines
from tests.formats.importers.native_people import NAMES, annotated, make_person

IDS = {name: i for i, name in NAMES.items()}
FOUND = {NAMES[785]: [make_person(1), make_person(2)]}
# Format, the file to damage, what makes it.
FILES = {
    "openpose": ("000000000785_keypoints.json", lambda folder: write_openpose(folder, FOUND)),
    "openpose-coco": ("coco.json", lambda folder: write_openpose_coco(folder / "coco.json", FOUND)),
    "alphapose": ("a.json", lambda folder: write_alphapose(folder / "a.json", FOUND)),
    "mmpose": ("000000000785.json", lambda folder: write_mmpose(folder, FOUND)),
    "detectron2": ("d.json", lambda folder: write_detectron2(folder / "d.json", FOUND, IDS)),
    "coco": ("c.json", lambda folder: write_coco(folder / "c.json", FOUND, IDS, "coco17")),
}


def run(kind: str, folder: Path):
    format = kind.partition("-")[0]
    is_folder = kind in ("openpose", "mmpose")
    return import_predictions(format, folder if is_folder else folder / FILES[kind][0], annotated(NAMES))


def damaged(kind: str, folder: Path, change) -> str:
    """The message an import answers a damaged file with."""
    name, write = FILES[kind]
    write(folder)
    value = json.loads((folder / name).read_text())
    changed = change(value)  # in place, or anew
    value = value if changed is None else changed
    (folder / name).write_text(value if isinstance(value, str) else json.dumps(value))
    with pytest.raises(InputError) as error:
        run(kind, folder)
    message = str(error.value)
    assert "\n" not in message and len(message) < 400
    return message


def put(*where, value):
    """A change: the value at a place, e.g. `put("people", 0, "pose_keypoints_2d", value=[])`."""

    def change(data):
        for key in where[:-1]:
            data = data[key]
        data[where[-1]] = value

    return change


def drop(*where):
    def change(data):
        for key in where[:-1]:
            data = data[key]
        del data[where[-1]]

    return change


P = "pose_keypoints_2d"
LEFT = "hand_left_keypoints_2d"
MALFORMED = [
    ("openpose", lambda data: json.dumps(data)[:-20], "785_keypoints.json: line 1, column", "cut off"),
    ("openpose", lambda data: [data], "785_keypoints.json", "has no 'people'"),
    ("openpose", put("people", value={}), "785_keypoints.json: people is an object; expected a list"),
    ("openpose", put("people", 1, value=3), "people[1] is 3; expected an object"),
    ("openpose", drop("people", 1, P), "785_keypoints.json: people[1]: has no 'pose_keypoints_2d'"),
    ("openpose", put("people", 1, P, value=[1.0] * 74), "people[1]", "a list of 74", "75 (openpose_body25)"),
    ("openpose", put("people", 0, P, value=[1.0] * 45), "people[0]", "a list of 45", "54 (openpose_coco18)"),
    ("openpose", put("people", 0, P, 4, value="x"), f"people[0]: {P}[4] (neck y) is the text 'x'"),
    ("openpose", put("people", 0, P, 4, value=float("nan")), f"{P}[4] (neck y) is nan; expected a finite"),
    ("openpose", put("people", 0, LEFT, value=[0.5]), "people[0]: hand_left_keypoints_2d", "63"),
    ("openpose", put("people", 0, LEFT, value=3), "hand_left_keypoints_2d is 3"),
    ("openpose-coco", put(0, "keypoints", value=[1] * 18), "results[0]", "18 numbers"),
    ("alphapose", put(1, "keypoints", 405, value=None), "results[1]", "[405] (right_little_4 x) is null"),
    ("alphapose", put(1, "keypoints", value=[1.0] * 63), "results[1]", "63 numbers", "17, 26, 133, 136"),
    ("alphapose", drop(0, "score"), "results[0]: has no 'score'"),
    ("alphapose", put(0, "image_id", value=1.5), "image_id is 1.5; expected a whole number or a file name"),
    ("alphapose", put(0, "image_id", value=True), "image_id is true"),
    ("alphapose", put(0, "category_id", value=2), "category_id is 2; expected 1 (person)"),
    ("alphapose", put(0, "idx", value=float("inf")), "results[0]", "further key holds NaN"),
    ("alphapose", lambda data: {"1.jpg": {"bodies": []}}, "--format cmu or open; run AlphaPose without"),
    ("mmpose", put(0, "keypoints", value=[[1, 2, 3]] * 17), "instances[0]", "one [x, y] per keypoint"),
    ("mmpose", put(0, "keypoints", value=[[1, 2]] * 21), "instances[0]: keypoint"),
    ("mmpose", put(1, "keypoints", 5, value=7), "785.json: instances[1]: keypoints is a list of 133"),
    ("mmpose", put(1, "keypoints", 5, value=["a", 2]), "keypoints[15] (left_shoulder x) is the text 'a'"),
    ("mmpose", put(0, "keypoint_scores", value=[0.5] * 17), "keypoint_scores is a list of 17; expected 133"),
    ("mmpose", put(0, "keypoint_scores", 3, value=None), "keypoints[11] (left_ear v) is null"),
    ("mmpose", put(0, "bbox", value=[1, 2, 3]), "bbox is a list of 3; expected [[x1, y1, x2, y2]]"),
    ("mmpose", put(0, "bbox", value=[[1, 2, 3, "4"]]), "bbox[3]", "the text '4'"),
    ("mmpose", put(0, "bbox_score", value=[0.5]), "bbox_score is a list of 1"),
    ("mmpose", put(0, "keypoint_scores", 3, value=99), "go up to 99", "--score-scale"),
    ("mmpose", lambda data: [{"frame_id": 0, "instances": data}], "frames of a video"),
    ("mmpose", lambda data: {"meta_info": {}}, "instances is an object; expected a list of objects"),
    ("detectron2", put(0, "bbox", value={"x": float("nan")}), "further key holds NaN"),
    ("coco", put(0, "keypoints", value={}), "results[0] (image_id 785): keypoints is an object"),
    ("coco", put(0, "score", value="high"), "score is the text 'high'"),
    ("coco", lambda data: {"annotations": []}, "holds annotations; expected COCO results"),
    ("coco", put(0, "keypoints", 2, value=1e300), "keypoints[2] (nose v) is 1e+300"),
]  # fmt: skip


@pytest.mark.parametrize(
    ("kind", "change", "parts"), [(kind, change, rest) for kind, change, *rest in MALFORMED]
)
def test_one_line_says_where_and_what(tmp_path, kind, change, parts):
    message = damaged(kind, tmp_path, change)
    assert all(part in message for part in parts), message


@pytest.mark.parametrize("span", ["[0, 1]", "[-1, 1]"])
def test_normalised_openpose_coordinates_are_refused(tmp_path, span):
    points = make_person().points_px / (640, 480)
    points = points if span == "[0, 1]" else 2 * points - 1
    write_openpose(tmp_path, {NAMES[785]: [make_person(points_px=points)]})
    with pytest.raises(InputError) as error:
        import_predictions("openpose", tmp_path, annotated(NAMES))
    assert span in str(error.value) and "expected pixels" in str(error.value)


def test_openpose_coordinates_of_another_size_are_refused(tmp_path):
    # The output of a 320 x 240 image in a network input of 656 x 368.
    write_openpose(tmp_path, FOUND)
    with pytest.raises(InputError, match="body parts lie outside their images.*--keypoint_scale 0"):
        import_predictions("openpose", tmp_path, annotated(NAMES, size=(320, 240)))


@pytest.mark.parametrize("kind", FILES)
def test_paths_that_are_not_there(tmp_path, kind):
    with pytest.raises(InputError, match="cannot be read|holds no file"):
        run(kind, tmp_path)
    format = kind.partition("-")[0]
    with pytest.raises(InputError, match="nowhere"):
        import_predictions(format, tmp_path / "nowhere", annotated(NAMES))


def test_a_file_where_a_folder_belongs(tmp_path):
    (tmp_path / "p.json").write_text("[]")
    with pytest.raises(InputError, match="pred_out_dir"):
        import_predictions("mmpose", tmp_path / "p.json", annotated(NAMES))


def test_unknown_formats_are_named(tmp_path):
    with pytest.raises(InputError, match="'posenet'.*openpose, alphapose, mmpose, detectron2, coco"):
        import_predictions("posenet", tmp_path, annotated(NAMES))


def test_predictions_of_other_images_are_refused(tmp_path):
    write_mmpose(tmp_path, FOUND)
    with pytest.raises(InputError, match="none of its 1 images is annotated.*'000000000785'.*other.jpg"):
        import_predictions("mmpose", tmp_path, annotated({1: "other.jpg"}))
    with pytest.raises(InputError, match="no image"):
        import_predictions("mmpose", tmp_path, annotated({}))


# ---- anything at all

JUNK = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5)
    | st.sampled_from([0, 1, 785, 10**30, -1e308, NAMES[785], "../x", "\ud800"]),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(
        st.sampled_from(["people", "keypoints", "image_id", "bbox", "instances", P, LEFT]), inner, max_size=3
    ),
    max_leaves=8,
)  # fmt: skip


def places(value, where=()):
    """All places in a JSON value, a few of each list."""
    yield where
    if isinstance(value, dict):
        for key in value:
            yield from places(value[key], (*where, key))
    elif isinstance(value, list):
        for i in sorted({0, len(value) // 2, len(value) - 1} & set(range(len(value)))):
            yield from places(value[i], (*where, i))


@pytest.fixture(scope="module")
def sound(tmp_path_factory) -> dict[str, tuple[Path, object]]:
    """Per kind, a folder and the content of its file."""
    folders = {}
    for kind, (name, write) in FILES.items():
        folder = tmp_path_factory.mktemp(kind)
        write(folder)
        folders[kind] = (folder, json.loads((folder / name).read_text()))
    return folders


@settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(data=st.data())
@pytest.mark.parametrize("kind", FILES)
def test_nothing_else_escapes(sound, kind, data):
    folder, value = sound[kind]
    value = copy.deepcopy(value)
    for _ in range(data.draw(st.integers(1, 3))):
        where = data.draw(st.sampled_from(list(places(value))))
        junk = data.draw(JUNK)
        if not where:
            value = junk
            continue
        parent = value
        for key in where[:-1]:
            parent = parent[key]
        if data.draw(st.booleans()):
            parent[where[-1]] = junk
        else:
            del parent[where[-1]]
    (folder / FILES[kind][0]).write_text(json.dumps(value))
    try:
        imported = run(kind, folder)
    except InputError as error:
        assert "\n" not in str(error)
        return
    check_detections(imported.detections, annotated(NAMES))
    for people in imported.detections.values():
        assert ((people.scores >= 0) & (people.scores <= 1)).all()
    for line in summary_lines(imported.summary):
        assert line.encode() and line.isprintable()
    write_detections(folder / "out" / "d.json", imported.detections, imported.extras)


@settings(max_examples=40, deadline=None)
@given(
    content=st.binary(max_size=60) | st.text('[]{}",:0123456789.eE-\\uNaInfty', max_size=60).map(str.encode)
)
@pytest.mark.parametrize("kind", FILES)
def test_files_that_are_no_json(sound, kind, content):
    folder, _ = sound[kind]
    (folder / FILES[kind][0]).write_bytes(content)
    with pytest.raises(InputError) as error:
        run(kind, folder)
    assert "\n" not in str(error.value)


@settings(max_examples=60, deadline=None)
@given(
    points=st.lists(st.tuples(st.floats(-50, 700), st.floats(-50, 700)), min_size=17, max_size=17),
    scores=st.lists(st.floats(0, 1, width=32), min_size=17, max_size=17),
)
@pytest.mark.parametrize("format", ["alphapose", "mmpose", "detectron2"])
def test_any_numbers_come_back(tmp_path_factory, format, points, scores):
    folder = tmp_path_factory.mktemp("numbers")
    xy, s = np.zeros((136, 2)), np.zeros(136)
    xy[:17], s[:17] = points, scores
    person = make_person(points_px=xy, scores=s)
    path = folder if format == "mmpose" else folder / "p.json"
    write = {"alphapose": write_alphapose, "mmpose": write_mmpose, "detectron2": write_detectron2}[format]
    how = {"ids": IDS} if format == "detectron2" else {"layout": "coco17"}
    write(path, {NAMES[785]: [person]}, **how)
    found = import_predictions(format, path, annotated(NAMES)).detections[785]
    given_ = s[:17] > 0
    assert np.array_equal(np.isfinite(found.keypoints_px[0, :17]).all(axis=-1), given_)
    assert np.allclose(found.keypoints_px[0, :17][given_], xy[:17][given_], rtol=1e-6, atol=1e-6)
    assert np.array_equal(found.scores[0, :17], s[:17])
