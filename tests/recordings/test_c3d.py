"""C3D: what header and parameters both state is compared; names, units, and the reader's own reasons."""

import numpy as np
import pytest

from hicp_lib.core.errors import InputError
from hicp_lib.recordings.c3d import write_c3d
from hicp_lib.recordings.qualisys import read_mocap, write_tsv
from hicp_lib.recordings.recording import open_recording
from tests.recordings.c3d_files import make_c3d

POINTS = np.array([[[1000, 500, 900]], [[1010, 500, 905]], [[1020, 500, 910]], [[1030, 500, 915]]], float)
ANALOG = {"USED": 2, "RATE": 100.0, "GEN_SCALE": 1.0, "SCALE": [1.0, 1.0], "OFFSET": [0, 0],
          "LABELS": [b"a", b"b"]}  # fmt: skip


def _file(tmp_path, content):
    path = tmp_path / "mocap.c3d"
    path.write_bytes(content)
    return path


@pytest.mark.parametrize(
    ("changed", "metres"),
    [
        ({}, 1e-3),
        ({"n_analog": 2, "ANALOG": ANALOG}, 1e-3),
        ({"header": {"first": 30, "last": 33}}, 1e-3),
        ({"point": {"FRAMES": 0}}, 1e-3),
        ({"point": {"RATE": 100.2}}, 1e-3),
        ({"scale": -0.1}, 1e-3),
        ({"point": {"UNITS": [b"m "]}}, 1.0),
        ({"point": {"UNITS": [b"mete"]}}, 1.0),
        ({"point": {"UNITS": [b"CM"]}}, 0.01),
        ({"point": {"UNITS": [b"inches"]}}, 0.0254),
        ({"TRIAL": {"ACTUAL_START_FIELD": [1, 0], "ACTUAL_END_FIELD": [4, 0]}}, 1e-3),
    ],
)
def test_what_agrees_is_read(tmp_path, changed, metres):
    found = read_mocap(_file(tmp_path, make_c3d(POINTS, **changed)))
    np.testing.assert_allclose(found.points_m, metres * POINTS, rtol=1e-6)
    assert found.names == ("m",) and found.rate_hz == pytest.approx(100, rel=0.003)


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"n_analog": 2}, "the bytes from frame to frame (24, 16)"),
        ({"n_analog": 2, "ANALOG": ANALOG | {"USED": 0}}, "the bytes from frame to frame (24, 16)"),
        ({"n_analog": 2, "ANALOG": ANALOG, "point": {"RATE": 100.001}}, "from frame to frame"),
        ({"header": {"n_analog": 1}}, "the bytes from frame to frame (20, 16)"),
        ({"header": {"m": 2}}, "the bytes from frame to frame (32, 16)"),
        ({"header": {"scale": 0.1}}, "the bytes from frame to frame (8, 16)"),
        ({"header": {"rate": 200.0}}, "POINT:RATE (200, 100)"),
        ({"header": {"start": 3}}, "POINT:DATA_START (3, 4)"),
        ({"header": {"last": 5}}, "counts 5 (header)"),
        ({"header": {"last": 3}}, "counts 3 (header)"),
        ({"point": {"FRAMES": 3}}, "4 (header), 3 (POINT:FRAMES)"),
        ({"point": {"FRAMES": 6}}, "4 (header), 6 (POINT:FRAMES)"),
        ({"n_analog": 2, "ANALOG": ANALOG | {"OFFSET": [0.0, 0.0]}}, "OFFSET parameter is not an INT"),
        ({"processor": 86}, "MIPS processor type not supported"),
        ({"point": {"UNITS": [b"pt"]}}, "POINT:UNITS is none of mm, cm, m, in, ft"),
        ({"point": {"UNITS": None}}, "POINT:UNITS"),
        ({"point": {"RATE": 0.0}, "header": {"rate": 0.0}}, "POINT:RATE"),
        ({"point": {"LABELS": None}}, "POINT:LABELS"),
    ],
)
def test_what_contradicts_itself_or_is_lacking_is_told_in_one_line(tmp_path, changed, said):
    path = _file(tmp_path, make_c3d(POINTS, **changed))
    with pytest.raises(InputError) as told:
        read_mocap(path)
    message = str(told.value)
    assert said in message and message.startswith(str(path)) and "\n" not in message


def test_the_size_of_the_file_decides_where_it_can(tmp_path):
    """MotionMonitor's header counts the analog numbers of a sample, not of a frame."""
    points = np.tile(POINTS, (100, 1, 1))
    content = make_c3d(points, n_analog=4, header={"n_analog": 2}, ANALOG=ANALOG | {"RATE": 200.0})
    np.testing.assert_allclose(read_mocap(_file(tmp_path, content)).points_m, points / 1e3, rtol=1e-6)


def test_a_file_without_frames_is_refused(tmp_path):
    content = make_c3d(POINTS[:1], header={"last": 0}, point={"FRAMES": 0})[:1536]
    with pytest.raises(InputError, match="mocap.c3d: holds no frames; export it again"):
        read_mocap(_file(tmp_path, content))


@pytest.mark.parametrize("trial", [70_000, None])
@pytest.mark.parametrize("count", [4464, 65_535])
def test_more_frames_than_16_bits_count(tmp_path, count, trial):
    points = np.stack([0.01 * np.arange(70_000), np.full(70_000, 5.0), np.full(70_000, 7.0)], axis=1)[:, None]
    field = {"ACTUAL_START_FIELD": [1, 0], "ACTUAL_END_FIELD": [70_000 % 2**16, 1]}
    content = make_c3d(
        points, header={"last": count}, point={"FRAMES": count}, **({"TRIAL": field} if trial else {})
    )
    path = _file(tmp_path, content)
    with pytest.raises(InputError, match=rf"{count} \(header\).*700\d\d \(size of the file\)"):
        read_mocap(path)


@pytest.mark.parametrize(
    ("labels", "names"),
    [
        ([b"wrist", b"wrist", b"elbow"], ("wrist_1", "wrist_2", "elbow")),
        ([b"", b"a", b" "], ("unnamed_1", "a", "unnamed_2")),
        ([b"a", b"", b"b"], ("a", "unnamed", "b")),
        ([b"a", b"b"], ("a", "b", "unnamed")),
        ([b"a", b"b", b"c", b"d"], ("a", "b", "c")),
        (["épaule".encode("latin-1"), "épaule 2".encode("latin-1"), b"c"], ("épaule", "épaule 2", "c")),
        (["épaule".encode(), b"b", b"c"], ("épaule", "b", "c")),
    ],
)
def test_names_repeated_empty_or_of_another_code_page(tmp_path, labels, names):
    points = np.tile(POINTS, (1, 3, 1)) + [[[0], [1], [2]]]
    found = read_mocap(_file(tmp_path, make_c3d(points, labels)))
    assert found.names == names
    for write, name in ((write_tsv, "again.tsv"), (write_c3d, "again.c3d")):
        write(tmp_path / name, found)
        assert read_mocap(tmp_path / name).names == names


def test_names_that_numbering_would_make_alike_are_refused(tmp_path):
    content = make_c3d(np.tile(POINTS, (1, 3, 1)), [b"a", b"a", b"a_1"])
    with pytest.raises(InputError, match="POINT:LABELS"):
        read_mocap(_file(tmp_path, content))


def test_missing_markers_are_missing(tmp_path):
    points = POINTS.copy()
    points[1:3] = np.nan
    found = read_mocap(_file(tmp_path, make_c3d(points)))
    assert np.isnan(found.points_m[:, 0, 0]).tolist() == [False, True, True, False]


def test_a_recording_may_hold_c3d_in_place_of_tsv(small):
    (small / "mocap.c3d").write_bytes(make_c3d(POINTS))
    assert open_recording(small).mocap_path == small / "mocap.c3d"
    write_tsv(small / "mocap.tsv", read_mocap(small / "mocap.c3d"))
    assert open_recording(small).mocap_path == small / "mocap.tsv"
