"""TUM's text files: what is written is read back, anything malformed is an InputError of one line."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from hicp_lib.core.errors import InputError
from hicp_lib.recordings.tum import (
    associate,
    read_file_list,
    read_poses,
    remarks,
    write_file_list,
    write_poses,
)

TIMES = st.lists(st.integers(0, 2**40), min_size=1, max_size=12, unique=True).map(
    lambda ticks: np.sort(np.array(ticks)) / 1e3
)
POSE = "0 0 0 0 0 0 1"


@given(TIMES, st.integers(0, 2**31))
def test_poses_are_read_as_they_were_written(tmp_path_factory, times_s, seed):
    rng = np.random.default_rng(seed)
    T = np.tile(np.eye(4), (len(times_s), 1, 1))
    T[:, :3, :3] = Rotation.random(len(times_s), random_state=rng).as_matrix()
    T[:, :3, 3] = rng.uniform(-2, 2, (len(times_s), 3))
    path = tmp_path_factory.mktemp("tum") / "groundtruth.txt"
    write_poses(path, times_s, T)
    read_s, read_T = read_poses(path)
    np.testing.assert_allclose(read_s, times_s, atol=1e-6)
    np.testing.assert_allclose(read_T, T, atol=1e-8)


@given(TIMES)
def test_lists_are_read_as_they_were_written(tmp_path_factory, times_s):
    names = [f"rgb/{k}.png" for k in range(len(times_s))]
    path = tmp_path_factory.mktemp("tum") / "rgb.txt"
    write_file_list(path, times_s, names)
    read_s, read_names = read_file_list(path)
    np.testing.assert_allclose(read_s, times_s, atol=1e-6)
    assert read_names == names


@given(st.one_of(st.binary(max_size=80), st.text("0123456789.-+e# \nnaif/rgb", max_size=80).map(str.encode)))
def test_whatever_a_file_holds_it_is_read_or_refused_in_one_line(tmp_path_factory, content):
    path = tmp_path_factory.mktemp("tum") / "file.txt"
    path.write_bytes(content)
    for read in (read_file_list, read_poses):
        try:
            times_s, values = read(path)
        except InputError as error:
            assert str(path) in str(error) and "\n" not in str(error)
        else:
            assert len(times_s) == len(values) > 0
            assert np.isfinite(times_s).all() and (np.diff(times_s) > 0).all()


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("1.0", "line 1: has 1 fields"),
        ("1.0 a.png\n0.5 b.png", "line 2: timestamp 0.5 is before"),
        ("1.0 a.png\n1.0 b.png\n0.99 c.png", "line 3: timestamp 0.99 is before"),
        ("1700000000000.0 a.png", "line 1: timestamp 1700000000000.0 looks like milliseconds"),
        ("1700000000000000 a.png", "looks like microseconds; expected seconds"),
        ("1700000000000000000 a.png", "looks like nanoseconds; expected seconds"),
        ("one a.png", "line 1: 'one' is not a finite number"),
        ("nan a.png", "not a finite number"),
        ("1.0 ../a.png", "expected a file inside"),
        ("1.0 /etc/passwd", "expected a file inside"),
        ("1.0 C:\\a.png", "expected a file inside"),
        ("# nothing", "holds no lines"),
    ],
)
def test_lists_say_what_is_wrong(tmp_path, text, expected):
    path = tmp_path / "rgb.txt"
    path.write_text(text)
    with pytest.raises(InputError, match=expected.replace("\\", r"\\")):
        read_file_list(path)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("1.0 0 0 0 0 0 0 2", "line 1: has a quaternion of length 2"),
        ("1.0 0 0 0 0 0 0 0", "quaternion of length 0"),
        ("1.0 0 0 0 0 0 1", "has 7 fields"),
        (f"1.0 {POSE}\n0.9 {POSE}", "line 2: timestamp 0.9"),
        ("1.0 0 inf 0 0 0 0 1", "'inf' is not a finite number"),
    ],
)
def test_poses_say_what_is_wrong(tmp_path, text, expected):
    path = tmp_path / "groundtruth.txt"
    path.write_text(text)
    with pytest.raises(InputError, match=expected):
        read_poses(path)


def test_rounded_quaternions_become_rotations(tmp_path):
    path = tmp_path / "groundtruth.txt"
    path.write_text("0 1 2 3 0.002 0 0.7071 0.7071\n")
    R = read_poses(path)[1][0, :3, :3]
    np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-12)


def _associate_plainly(a_s, b_s, most_s):
    """The definition: of all pairs near enough, the nearest first, each time used once."""
    pairs = sorted((abs(a - b), i, j) for i, a in enumerate(a_s) for j, b in enumerate(b_s))
    chosen, used_a, used_b = [], set(), set()
    for difference, i, j in pairs:
        if difference <= most_s and i not in used_a and j not in used_b:
            chosen.append((i, j))
            used_a.add(i)
            used_b.add(j)
    return sorted(chosen)


# Quarters of a millisecond are exact in binary, so nothing hangs on rounding.
TICKS = st.lists(st.integers(0, 400), max_size=15, unique=True).map(lambda ticks: np.sort(ticks) / 2048)


@given(TICKS, TICKS)
def test_times_are_paired_nearest_first(a_s, b_s):
    a, b = associate(a_s, b_s, 40 / 2048)
    assert list(zip(a.tolist(), b.tolist(), strict=True)) == _associate_plainly(a_s, b_s, 40 / 2048)


@pytest.mark.parametrize(
    ("length", "fits"), [(0.9901, True), (1.0099, True), (0.9899, False), (1.0101, False)]
)
def test_quaternions_may_be_off_by_a_hundredth(tmp_path, length, fits):
    path = tmp_path / "groundtruth.txt"
    path.write_text(f"0 1 2 3 0 {length} 0 0\n")
    if fits:
        np.testing.assert_allclose(read_poses(path)[1][0, :3, :3], np.diag([-1, 1, -1]), atol=1e-12)
    else:
        with pytest.raises(InputError, match="quaternion of length"):
            read_poses(path)


def test_numbers_beyond_any_time_or_place_are_refused(tmp_path):
    path = tmp_path / "rgb.txt"
    path.write_text("9e10 a.png\n")
    assert read_file_list(path)[0].tolist() == [9e10]
    path.write_text("1e20 a.png\n")
    with pytest.raises(InputError, match="'1e20' is not a finite number"):
        read_file_list(path)


def test_by_default_times_are_paired_up_to_20_ms():
    assert [len(rows) for rows in associate(np.array([0.0, 1.0]), np.array([0.0199, 1.0201]))] == [1, 1]
    a, b = associate(np.array([0.0]), np.array([0.02]))
    assert (a.tolist(), b.tolist()) == ([0], [0])


def test_a_file_that_is_no_text_or_not_there_is_told(tmp_path):
    (tmp_path / "rgb.txt").write_bytes(b"\xff\xfe1.0")
    with pytest.raises(InputError, match="is not text in UTF-8"):
        read_file_list(tmp_path / "rgb.txt")
    with pytest.raises(InputError, match="a recording needs it"):
        read_file_list(tmp_path / "depth.txt")


def test_of_lines_with_the_same_time_the_first_is_read_and_the_rest_counted(tmp_path):
    path = tmp_path / "groundtruth.txt"
    lines = [
        f"{t} {x} 0 0 0 0 0 1" for t, x in ((1.0, 0), ("1.50", 1), (1.5, 2), (1.5, 3), (2.0, 4), (2.0, 5))
    ]
    path.write_text("# timestamp tx ty tz qx qy qz qw\n" + "\n".join(lines))
    times_s, T = read_poses(path)
    assert times_s.tolist() == [1, 1.5, 2] and T[:, 0, 3].tolist() == [0, 1, 4]
    assert remarks(path, times_s) == ["3 lines repeat the time before and are skipped"]
    path.write_text("\n".join(lines[:2]))
    assert remarks(path, read_poses(path)[0]) == []


@pytest.mark.parametrize(
    ("step", "said"),
    [
        (1 / 30, ""),
        (5.0, ""),
        (5.1, "0.2 frames per second; times are expected in seconds (these look like milliseconds)"),
        (1e3 / 30, "0.03 frames per second; times are expected in seconds (these look like milliseconds)"),
        (1e6 / 30, "3e-05 frames per second; times are expected in seconds (these look like microseconds)"),
        (1e9 / 30, "3e-08 frames per second; times are expected in seconds (these look like nanoseconds)"),
    ],
)
def test_times_that_are_hardly_seconds_are_told(tmp_path, step, said):
    path = tmp_path / "rgb.txt"
    write_file_list(path, 100 + step * np.arange(9), [f"{k}.png" for k in range(9)])
    assert remarks(path, read_file_list(path)[0]) == [said] * bool(said)
    write_file_list(path, np.array([step]), ["0.png"])
    assert remarks(path, np.array([step])) == []
