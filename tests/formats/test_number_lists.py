"""Lists of keypoints that become arrays while a file is read: the same content, whatever the blocks cut."""

import json
import time

import numpy as np
import pytest

from hicp_lib.core.errors import InputError
from hicp_lib.formats import number_lists
from hicp_lib.formats.number_lists import read_people, read_people_in_parts

ROWS = [
    {"image_id": 1, "keypoints": [0.1, 2, 3e-7, -0.0], "score": 0.5},
    {"keypoints": [], "image_id": 2},
    {"image_id": 3, "keypoints": [9007199254740993, 1e300, 1.5]},
    {"image_id": 4, "note": 'of "keypoints": [1, 2]', "keypoints": [7]},
]
ODD = [
    {"keypoints": [True, 1]}, {"keypoints": [None]}, {"keypoints": ["1"]}, {"keypoints": [[1, 2]]},
    {"keypoints": None}, {"keypoints": "x"}, {"more": {"keypoints": [1, 2]}}, 3, {'a"keypoints': [1]},
]  # fmt: skip


def plain(value):
    """Arrays as lists, all numbers of which are floats."""
    if isinstance(value, dict):
        return {key: plain(of) for key, of in value.items()}
    if isinstance(value, list | np.ndarray):
        return [plain(of) for of in value]
    return float(value) if type(value) is int else value


@pytest.fixture(params=[2**24, 64, 17, 5])
def blocks(request, monkeypatch):
    monkeypatch.setattr(number_lists, "_BLOCK_BYTES", request.param)


@pytest.mark.parametrize(
    "content", [ROWS, {"annotations": ROWS, "categories": [{"keypoints": ["a"]}]}, [], {}]
)
@pytest.mark.parametrize("style", [{}, {"indent": 1}, {"separators": (",", ":")}])
def test_content_is_that_of_json(tmp_path, blocks, content, style):
    path = tmp_path / "a.json"
    path.write_text(json.dumps(content, **style))
    assert plain(read_people(path)) == plain(json.loads(path.read_text()))


@pytest.mark.parametrize(
    "content", [ROWS, {"annotations": ROWS}, [], {}, [ROWS[0]] * 9, [{"of": [{}]}] * 5, 3]
)
@pytest.mark.parametrize("style", [{}, {"indent": 1}, {"separators": (",", ":")}])
def test_parts_are_together_the_whole(tmp_path, blocks, content, style):
    path = tmp_path / "a.json"
    path.write_text(json.dumps(content, **style))
    parts = list(map(plain, read_people_in_parts(path)))
    assert (sum(parts, []) if isinstance(content, list) else parts[0]) == plain(content)


def test_a_long_list_is_never_held_as_a_whole(tmp_path, monkeypatch):
    monkeypatch.setattr(number_lists, "_BLOCK_BYTES", 2000)
    (tmp_path / "a.json").write_text(json.dumps(ROWS * 200))
    parts = list(read_people_in_parts(tmp_path / "a.json"))
    assert sum(map(len, parts)) == 4 * 200 and max(map(len, parts)) < 40


def test_inner_lists_of_that_name_are_not_the_people(tmp_path, blocks):
    inner = {"info": [{"annotations": [{"keypoints": [1]}]}] * 3, "annotations": ROWS}
    (tmp_path / "a.json").write_text(json.dumps(inner))
    assert plain(read_people(tmp_path / "a.json")) == plain(inner)


def test_very_many_inner_lists_take_no_time(tmp_path):
    inner = {"info": [{"annotations": []}] * 200_000}
    (tmp_path / "a.json").write_text(json.dumps(inner))
    start_s = time.process_time()
    assert read_people(tmp_path / "a.json") == inner
    assert time.process_time() - start_s < 5


@pytest.mark.parametrize("end", ["", "]]", "] 3", ", ]", " {}]", ', {"a": NaN}]', ", 1e]"])
def test_what_ends_a_list_is_checked_after_it(tmp_path, blocks, end):
    path = tmp_path / "a.json"
    path.write_text(json.dumps(ROWS)[:-1] + end)
    if "NaN" in end:  # read as ever
        last = [row for part in read_people_in_parts(path) for row in part][len(ROWS) :]
        assert len(last) == 1 and np.isnan(last[0]["a"])
    else:
        with pytest.raises(InputError, match="not JSON"):
            list(read_people_in_parts(path))


@pytest.mark.parametrize("odd", ODD)
def test_what_is_no_list_of_numbers_stays_as_it_is(tmp_path, blocks, odd):
    path = tmp_path / "a.json"
    path.write_text(json.dumps([*ROWS, odd, *ROWS]))
    assert read_people(path)[len(ROWS)] == odd
    assert [row for part in read_people_in_parts(path) for row in part][len(ROWS)] == odd


def test_lists_of_numbers_are_arrays(tmp_path):
    (tmp_path / "a.json").write_text(json.dumps(ROWS))
    first, _, third, _ = read_people(tmp_path / "a.json")
    assert first["keypoints"].dtype == third["keypoints"].dtype == float
    assert np.signbit(first["keypoints"][3]) and third["keypoints"][0] == float(9007199254740993)


@pytest.mark.parametrize(
    "content", ['[{"keypoints": [1, 2}]', '[{"keypoints": [1,, 2]}]', '[{"keypoints": [1]', ""]
)
def test_what_is_no_json_is_told_as_ever(tmp_path, blocks, content):
    path = tmp_path / "a.json"
    path.write_text(content)
    with pytest.raises(InputError, match="not JSON"):
        read_people(path)
