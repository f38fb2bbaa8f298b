"""CropCOCO's layout: points outside the picture are kept, and what contradicts itself is refused."""

import copy

import numpy as np
import pytest

from hicp_lib.core.errors import InputError
from hicp_lib.core.files import write_json
from hicp_lib.formats.annotations import read_annotations, write_annotations
from hicp_lib.formats.cropcoco import OUTSIDE

POINTS = [[0, 0, 3], [-12.5, 40, 3], [300, 200, 2], [310, 210, 1], *[[0, 0, 0]] * 13]
FILE = {
    "images": [{"id": 7, "file_name": "7.jpg", "width": 640, "height": 480}],
    "annotations": [
        {"id": 1, "image_id": 7, "bbox": [0, 0, 600, 400], "area": 9000.0, "iscrowd": 0,
         "keypoints": np.ravel(POINTS).tolist()}
    ],
}  # fmt: skip


def read(folder, **changes):
    content = copy.deepcopy(FILE)
    content["annotations"][0] |= changes
    write_json(folder / "file.json", content)
    return read_annotations(folder / "file.json")


def test_a_point_outside_is_not_labelled_and_keeps_the_place_it_has(tmp_path):
    people = read(tmp_path)
    assert people.visibility[0, :5].tolist() == [OUTSIDE, OUTSIDE, 2, 1, 0]
    assert np.isnan(people.keypoints_px[0, [0, 4]]).all()
    assert people.keypoints_px[0, 1].tolist() == [-12.5, 40]


def test_what_is_said_of_points_outside_is_written_as_it_was_read(tmp_path):
    people = read(tmp_path, pad_to_contain=[1.5] * 17)
    write_annotations(tmp_path / "again.json", people)
    again = read_annotations(tmp_path / "again.json")
    np.testing.assert_array_equal(again.visibility, people.visibility)
    np.testing.assert_array_equal(again.keypoints_px, people.keypoints_px)
    assert again.extras == people.extras == [{"pad_to_contain": [1.5] * 17}]


def moved(x, y):
    return np.ravel([[x, y, 3], *POINTS[1:]]).tolist()


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({"keypoints": moved(20, 30)}, "nose has v = 3 (outside the picture) at 20, 30, which is inside it"),
        ({"pad_to_contain": [1.5] * 16}, "pad_to_contain is a list of 16; expected a list of 17 numbers"),
        ({"pad_to_contain": "wide"}, "pad_to_contain is the text 'wide'; expected a list of 17 numbers"),
        ({"pad_to_contain": [1.5] * 16 + [None]}, "expected a list of 17 numbers"),
        ({"pad_to_contain": [1.2] * 17}, "nose has no place, but pad_to_contain 1.2 <= 1.25 asks for one"),
    ],
)
def test_what_contradicts_itself_is_refused_in_one_line(tmp_path, changes, expected):
    with pytest.raises(InputError) as error:
        read(tmp_path, **changes)
    assert expected in str(error.value) and "annotations[0] (id 1): " in str(error.value)
    assert "\n" not in str(error.value)


def test_a_place_rounded_to_the_border_is_outside_all_the_same(tmp_path):
    assert read(tmp_path, keypoints=moved(639.5, 30)).visibility[0, 0] == OUTSIDE
