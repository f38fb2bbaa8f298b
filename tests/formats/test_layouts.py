"""Names of keypoints and categories: what files in the wild call them, and what is refused."""

import json
from collections import Counter
from itertools import product

import numpy as np
import pytest

from hicp_lib.core.datafiles import DATA_DIR
from hicp_lib.core.errors import InputError
from hicp_lib.core.keypoints import COCO_NAMES, HAND_NAMES, INDEX, NAMES, TO_HALPE
from hicp_lib.formats.annotations import read_annotations
from hicp_lib.formats.detections import read_detections
from hicp_lib.formats.layouts import halpe_name, layouts_of

FINGERS = "thumb forefinger middle_finger ring_finger pinky_finger".split()
LIMBS = "shoulder elbow wrist hip knee ankle".split()


def both(*parts: str) -> list[str]:
    return [f"{side}_{part}" for part in parts for side in ("left", "right")]


# What data sets call their keypoints, and which of ours these are; "-" for one that we have not.
PUBLIC = {
    "AIC": (
        [*(f"{side} {part}" for limb in (("Shoulder", "Elbow", "Wrist"), ("Hip", "Knee", "Ankle"))
           for side in ("Right", "Left") for part in limb), "Head top", "Neck"],
        "right_shoulder right_elbow right_wrist left_shoulder left_elbow left_wrist right_hip right_knee "
        "right_ankle left_hip left_knee left_ankle head_top neck",
    ),
    "CrowdPose": ([*both(*LIMBS), "head", "neck"], " ".join([*both(*LIMBS), "head_top", "neck"])),
    "JHMDB": (
        ["neck", "belly", "head", *both(*LIMBS)], " ".join(["neck - -", *both(*LIMBS)]),
    ),
    "PoseTrack": (
        ["nose", "head_bottom", "head_top", *both("ear", *LIMBS)],
        " ".join(["nose neck head_top", *both("ear", *LIMBS)]),
    ),
    "MPII": (
        "Right-ankle Right-knee Right-hip Left-hip Left-knee Left-ankle Pelvis Thorax Upper-neck Head-top "
        "Right-wrist Right-elbow Right-shoulder Left-shoulder Left-elbow Left-wrist".split(),
        "right_ankle right_knee right_hip left_hip left_knee left_ankle mid_hip - neck head_top right_wrist "
        "right_elbow right_shoulder left_shoulder left_elbow left_wrist",
    ),
    "Human3.6M": (
        ["root (pelvis)", *both("hip", "knee", "foot"), "spine", "thorax", "neck_base", "head",
         *both("shoulder", "elbow", "wrist")],
        " ".join(["mid_hip", *both("hip", "knee", "ankle"), "- - - -", *both("shoulder", "elbow", "wrist")]),
    ),
    "Human-Art": ([*COCO_NAMES, *both("finger", "toe")], " ".join([*COCO_NAMES, "- - - -"])),
    "Halpe as MMPose has it": (
        [*COCO_NAMES, "head", "neck", "hip", *NAMES[20:26]], " ".join(NAMES[:26]),
    ),
    "WholeBody as MMPose has it": (
        [*COCO_NAMES, *(f"left_{p}" for p in ("big_toe", "small_toe", "heel")),
         *(f"right_{p}" for p in ("big_toe", "small_toe", "heel")), *(f"face-{i}" for i in range(68)),
         *(f"{side}_{finger}{joint}" for side in ("left", "right")
           for finger, joint in [("hand_root", ""), *product(FINGERS, (1, 2, 3, 4))])],
        " ".join(NAMES[i] for i in TO_HALPE["wholebody133"]),
    ),
    "MediaPipe": (
        ["nose", *both("eye_inner"), *both("eye"), "mouth_left", "mouth_right",
         *both("pinky", "foot_index", "ankle")],
        " ".join(["nose - -", *both("eye"), "- - - -", *both("big_toe", "ankle")]),
    ),
}  # fmt: skip


@pytest.mark.parametrize("layout", PUBLIC)
def test_keypoints_of_public_data_sets(layout):
    names, ours = PUBLIC[layout]
    layouts, notes = layouts_of("here", names)
    assert layouts[len(names)].tolist() == [INDEX.get(name, -1) for name in ours.split()]
    assert ("keypoints left out" in notes) == ("-" in ours.split())


STYLES = {
    "as here": "{side}_{part}", "words": "{Side} {Part}", "camel": "{side}{Part}", "hyphen": "{Side}-{part}",
    "short": "{S}{Part}", "short bar": "{S}_{Part}", "small": "{s}_{part}", "behind": "{part}_{s}",
    "bracket": "{Part} ({S})", "dot": "{part}.{S}", "behind in full": "{Part}{Side}", "shout": "{S}{PART}",
}  # fmt: skip


@pytest.mark.parametrize("style", STYLES.values(), ids=STYLES)
def test_a_side_may_be_spelt_in_many_ways(style):
    for name in [*COCO_NAMES[1:], *both("big_toe", "small_toe", "heel", *HAND_NAMES)]:
        side, _, part = name.partition("_")
        words = {"side": side, "Side": side.title(), "s": side[0], "S": side[0].upper(), "part": part}
        words |= {"Part": part.title().replace("_", ""), "PART": part.upper()}
        assert halpe_name(style.format(**words)) == name


def test_every_name_of_ours_means_itself_and_no_spelling_two_keypoints():
    assert [halpe_name(name) for name in NAMES] == list(NAMES)
    names = json.loads((DATA_DIR / "keypoint_names.json").read_text())
    sided = [w for words in names["sided"].values() for w in words]
    made = [w for words in names["middle"].values() for w in words]
    for word in sided:
        made += sorted(
            {a + word for a in ("left", "right", "l", "r")} | {word + a for a in ("left", "right", "l", "r")}
        )
    assert [word for word, n in Counter(made).items() if n > 1] == []
    ours = {f"left_{name}" if name in names["sided"] else name for part in names.values() for name in part}
    assert ours - set(NAMES) == {"head", "left_foot", "left_other"}


def person_file(names=None, n=17, category="person", category_id=1, **more) -> dict:
    points = np.stack([50 + 5.0 * np.arange(n), 40 + 10.0 * np.arange(n), np.full(n, 2)], axis=1)
    person = {
        "id": 5, "image_id": 3, "category_id": category_id, "bbox": [40, 30, 120, 200], "area": 9000,
        "keypoints": points.ravel().tolist(),
    }  # fmt: skip
    kind = {"id": category_id, "name": category} | ({"keypoints": names} if names else {})
    image = {"id": 3, "file_name": "a/3.jpg", "width": 640, "height": 480}
    return {"images": [image], "annotations": [person], "categories": [kind]} | more


@pytest.fixture
def read(tmp_path):
    def read(content, keypoint_map=None):
        path, given = tmp_path / "a.json", tmp_path / "map.json"
        path.write_text(json.dumps(content))
        given.write_text(json.dumps(keypoint_map))
        return read_annotations(path, None if keypoint_map is None else given)

    return read


STRANGE = [*COCO_NAMES[:-1], "sternum"]


def test_a_name_that_is_not_understood_is_refused_and_a_map_says_what_it_means(read):
    with pytest.raises(InputError, match=r"not understood: 'sternum'; give --keypoint-map .*\"sternum\""):
        read(person_file(STRANGE))
    mapped = read(person_file(STRANGE), {"sternum": "RAnkle"})
    assert mapped.visibility[0, INDEX["right_ankle"]] == 2
    left_out = read(person_file(STRANGE), {"sternum": None})
    assert left_out.visibility[0, INDEX["right_ankle"]] == 0
    assert (
        "sternum" in left_out.notes["keypoints left out"]
        and "right_ankle" in left_out.notes["the body has no"]
    )


def test_maps_are_checked(read):
    for given, expected in [
        ({"sternum": "left_shoulder"}, "several mean one: 'left_shoulder', 'sternum'"),
        ({"sternum": None, "tail": None}, "not in the file: 'tail'"),
        ({"sternum": "tail"}, r"map.json: does not say what keypoints mean"),
        (dict.fromkeys(STRANGE), "none is a person's"),
        (3, "does not say what keypoints mean"),
        (["nose", None], "does not say what keypoints mean"),
    ]:
        with pytest.raises(InputError, match=expected):
            read(person_file(STRANGE), given)


@pytest.mark.parametrize("n", [14, 15, 16, 21])
def test_numbers_of_keypoints_that_several_layouts_have_need_names(read, n):
    with pytest.raises(
        InputError, match=f"keypoints has {3 * n} numbers; expected 3 per keypoint, of 17, 26"
    ):
        read(person_file(n=n))
    names = [*both(*LIMBS), "head_top", "neck", "nose", "left_eye", *both("big_toe", "heel"), "mid_hip"][:n]
    found = read(person_file(n=n), names)
    assert set(np.flatnonzero(found.visibility[0])) == {INDEX[name] for name in names}


def test_seventeen_without_names_are_cocos_and_this_is_told(read):
    assert "names" in read(person_file()).notes and "names" not in read(person_file(COCO_NAMES)).notes
    assert "names" not in read(person_file(n=136)).notes


@pytest.mark.parametrize("category_id", [0, 1, 2, 90])
@pytest.mark.parametrize("name", ["person", "Person", "HUMAN", "people"])
def test_people_are_told_by_their_categorys_name(read, name, category_id):
    people = read(person_file(COCO_NAMES, category=name, category_id=category_id))
    assert len(people) == 1 and people.category.id == category_id


def test_what_is_no_person_is_left_out_or_refused(read, tmp_path):
    with pytest.raises(InputError, match="none of its categories is of people: 'dog'; name one 'person'"):
        read(person_file(COCO_NAMES, category="dog"))
    content = person_file(COCO_NAMES, category_id=2)
    content["categories"].append({"id": 1, "name": "dog"})
    content["annotations"].append({"id": 6, "image_id": 3, "category_id": 1, "bbox": [1, 2, 3, 4]})
    people = read(content)
    assert people.ids.tolist() == [5] and people.notes["categories"].startswith("1 objects of other")
    content["annotations"][1]["category_id"] = 3
    with pytest.raises(
        InputError, match=r"annotations\[1\] \(id 6\): category_id is 3; expected one of 1, 2"
    ):
        read(content)
    results = tmp_path / "d.json"
    row = {"image_id": 3, "keypoints": [1.5, 7, 1] * 17, "score": 1}
    for category, sound in [(2, True), (1, False)]:
        results.write_text(json.dumps([row | {"category_id": category}]))
        if sound:
            assert len(read_detections(results, people)[3]) == 1
        else:
            with pytest.raises(InputError, match="category_id is 1; expected one of 2"):
                read_detections(results, people)
    two = person_file(COCO_NAMES)
    two["categories"].append({"id": 2, "name": "people", "keypoints": COCO_NAMES})
    with pytest.raises(InputError, match="several of its categories are of people"):
        read(two)
    two["categories"][1].pop("keypoints")  # a group of all kinds, as Roboflow writes it
    assert len(read(two)) == 1


def test_results_belong_to_the_image_they_name(read, tmp_path):
    content = person_file(COCO_NAMES)
    content["images"].append(content["images"][0] | {"id": 4, "file_name": "b/4.jpg"})
    people, results = read(content), tmp_path / "d.json"
    row = {"image_id": 3, "category_id": 1, "keypoints": [90, 70, 1] * 17, "score": 1}
    for name, image in [("4.jpg", 4), ("a/3.jpg", 3), ("b\\4.jpg", 4)]:
        results.write_text(json.dumps([row | {"file_name": name}]))
        assert [i for i, found in read_detections(results, people).items() if len(found)] == [image]
    results.write_text(json.dumps([row | {"file_name": "4.jpg"}, row | {"file_name": "5.jpg"}]))
    with pytest.raises(InputError, match=r"results\[1\] .*'5.jpg' is not among the annotated images"):
        read_detections(results, people)
    results.write_text(json.dumps([row | {"file_name": "5.jpg"}]))
    with pytest.raises(InputError, match="none of its 1 images is annotated"):
        read_detections(results, people)
