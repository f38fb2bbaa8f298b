"""Qualisys exports: what is written is read back, real variants too, bad files answered in a line."""

import ezc3d
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from hicp_lib.core.errors import InputError
from hicp_lib.recordings.c3d import write_c3d
from hicp_lib.recordings.qualisys import MotionCapture, read_mocap, write_tsv

HEADER = [
    "NO_OF_FRAMES\t2", "NO_OF_CAMERAS\t20", "NO_OF_MARKERS\t2", "FREQUENCY\t200", "NO_OF_ANALOG\t0",
    "ANALOG_FREQUENCY\t0", "DESCRIPTION\t--", "TIME_STAMP\t2022-06-03, 10:47:36.627\t94247.45402301",
    "TIME_STAMP\t2022-11-22, 22:00:35", "DATA_INCLUDED\t3D", "MARKER_NAMES\tx_HeadL\tx_HeadTop",
    "TRAJECTORY_TYPES\tMeasured\tMeasured",
]  # fmt: skip
ROWS = ["-786.729\t-34.016\t1064.381\t1\t2\t3", "0.000\t0.000\t0.000\t4.5\t5.5\t-6.5"]
AXES = "\t".join(f"{name} {axis}" for name in ("x_HeadL", "x_HeadTop") for axis in "XYZ")


def _file(tmp_path, lines, end="\r\n", name="mocap.tsv"):
    path = tmp_path / name
    path.write_bytes((end.join(lines) + end).encode())
    return path


@st.composite
def _captures(draw):
    n, m = draw(st.integers(1, 6)), draw(st.integers(1, 4))
    letters = st.text(st.characters(categories=("L", "N"), include_characters="_ -"), min_size=1, max_size=9)
    names = draw(st.lists(letters.map(str.strip).filter(bool), min_size=m, max_size=m, unique=True))
    coordinate = st.floats(-50, 50).filter(lambda x: abs(x) > 1e-3)
    points = np.array(draw(st.lists(coordinate, min_size=3 * n * m, max_size=3 * n * m))).reshape(n, m, 3)
    missing = np.array(draw(st.lists(st.booleans(), min_size=n * m, max_size=n * m))).reshape(n, m)
    rate_hz = draw(st.sampled_from([100.0, 120.0, 85.0, 59.94]))
    return MotionCapture(
        np.arange(n) / rate_hz, tuple(names), np.where(missing[..., None], np.nan, points), rate_hz
    )


@given(_captures())
@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_written_tsv_is_read_back_to_half_a_micrometre(tmp_path, mocap):
    write_tsv(tmp_path / "mocap.tsv", mocap)
    found = read_mocap(tmp_path / "mocap.tsv")
    assert found.names == mocap.names and found.rate_hz == mocap.rate_hz
    assert np.allclose(found.times_s, mocap.times_s, atol=6e-6)
    assert np.allclose(found.points_m, mocap.points_m, rtol=0, atol=5.1e-7, equal_nan=True)


def test_written_c3d_is_read_back_in_single_precision(tmp_path):
    rng = np.random.default_rng(0)
    points_m = rng.uniform(-3, 3, (7, 300, 3))  # more than 255 markers take a second list of labels
    points_m[2, 5] = points_m[:, 9] = np.nan
    mocap = MotionCapture(np.arange(7) / 120, tuple(f"marker_{k}" for k in range(300)), points_m, 120.0)
    write_c3d(tmp_path / "mocap.c3d", mocap)
    found = read_mocap(tmp_path / "mocap.c3d")
    assert found.names == mocap.names and found.rate_hz == 120
    assert np.allclose(found.times_s, mocap.times_s)
    assert np.allclose(found.points_m, points_m, rtol=1e-6, atol=1e-6, equal_nan=True)


def test_c3d_refuses_more_frames_than_the_format_counts_to(tmp_path):
    n = 65535
    mocap = MotionCapture(np.arange(n) / 100, ("a",), np.zeros((n, 1, 3)), 100.0)
    with pytest.raises(InputError, match="write TSV"):
        write_c3d(tmp_path / "mocap.c3d", mocap)
    assert not (tmp_path / "mocap.c3d").exists()


def test_a_real_header_with_repeated_and_unknown_keys_and_no_titles(tmp_path):
    extra = ["FILE_VERSION\t2.0.0", "EVENT\tstart\t17\t0.085", "COLOURS\tred\tblue"]
    found = read_mocap(_file(tmp_path, extra + HEADER + ROWS))
    assert found.names == ("x_HeadL", "x_HeadTop") and found.rate_hz == 200
    assert np.allclose(found.points_m[0], [[-0.786729, -0.034016, 1.064381], [0.001, 0.002, 0.003]])
    assert np.isnan(found.points_m[1, 0]).all()  # all three exactly zero
    assert np.allclose(found.times_s, [0, 1 / 200])


@pytest.mark.parametrize("end", ["\n", "\r\n"])
@pytest.mark.parametrize(
    ("titles", "leading", "times_s"),
    [
        (["Frame\tTime"], ["11\t0.05000\t", "12\t0.05500\t"], [0.05, 0.055]),
        (["Frame"], ["11\t", "12\t"], [0.05, 0.055]),
        (["Time"], ["0.05000\t", "0.05500\t"], [0.05, 0.055]),
        ([], ["11\t0.05000\t", "12\t0.05500\t"], [0.05, 0.055]),
    ],
)
@pytest.mark.parametrize("tail", ["", "\t"])
def test_frame_and_time_columns_titles_and_tabs_at_the_end(tmp_path, end, titles, leading, times_s, tail):
    lines = HEADER + [f"{t}\t{AXES}" for t in titles] + [a + r for a, r in zip(leading, ROWS, strict=True)]
    found = read_mocap(_file(tmp_path, [line + tail for line in lines], end))
    assert np.allclose(found.times_s, times_s)
    assert np.allclose(found.points_m[1, 1], [0.0045, 0.0055, -0.0065])


@pytest.mark.parametrize("titled", [True, False])
@pytest.mark.parametrize("code", [None, ["10:47:36:12", "10:47:36:13"], ["", "10:47:36;13.5"]])
@pytest.mark.parametrize("order", [("Frame", "Time", "SMPTE"), ("SMPTE", "Frame", "Time"), ("SMPTE", "Time")])
def test_an_external_clock_and_time_codes(tmp_path, titled, code, order):
    of = {"Frame": ["1", "2"], "Time": ["0.00000", "0.01250"], "SMPTE": code}
    order = [name for name in order if of[name]]
    lines = ["\t".join([*(of[name][k] for name in order), ROWS[k]]) for k in (0, 1)]
    titles = ["\t".join([*order, AXES])] if titled else []
    found = read_mocap(_file(tmp_path, [*_with("FREQUENCY\tEXT"), *titles, *lines]))
    assert found.rate_hz == pytest.approx(80) and np.allclose(found.times_s, [0, 0.0125])
    assert np.allclose(found.points_m[0, 1], [0.001, 0.002, 0.003])


@pytest.mark.parametrize("tail", ["", "\t"])
def test_one_frame_and_a_marker_never_seen_do_not_shift_columns(tmp_path, tail):
    header = [line.replace("\t2", "\t1") if line.startswith("NO_OF_FRAMES") else line for line in HEADER]
    found = read_mocap(_file(tmp_path, [*header, "1\t2\t3\t4\t5\t6" + tail]))
    assert np.allclose(found.points_m[0], [[0.001, 0.002, 0.003], [0.004, 0.005, 0.006]])
    lines = [*HEADER, f"1\t1\t2\t3\t\t\t{tail}", f"2\t1\t2\t4\t\t\t{tail}"]
    found = read_mocap(_file(tmp_path, lines))
    assert np.allclose(found.points_m[1, 0], [0.001, 0.002, 0.004]) and np.isnan(found.points_m[:, 1]).all()


def test_names_with_spaces_and_of_another_code_page_and_events(tmp_path):
    lines = [*_with("MARKER_NAMES\tépaule gauche\tx y\t"), "EVENT\tstart\t17\t0,085", *ROWS]
    path = tmp_path / "mocap.tsv"
    path.write_bytes("\r\n".join(lines).encode("latin-1"))
    assert read_mocap(path).names == ("épaule gauche", "x y")


@pytest.mark.parametrize("nothing", ["", "NULL", "NaN", "nan"])
def test_what_is_missing(tmp_path, nothing):
    first = "\t".join([nothing] * 3) + "\t1\t2\t3"
    found = read_mocap(_file(tmp_path, [*HEADER, first, f"1\t2\t3\t4\t5\t{nothing}"]))
    assert np.isnan(found.points_m[0, 0]).all() and np.isfinite(found.points_m[0, 1]).all()
    assert np.isnan(found.points_m[1, 1]).all() and np.isfinite(found.points_m[1, 0]).all()


def _without(key):
    return [line for line in HEADER if not line.startswith(key)]


def _with(line):
    return [line if old.startswith(line.split("\t")[0]) else old for old in HEADER]


@pytest.mark.parametrize(
    ("lines", "words"),
    [
        (_without("MARKER_NAMES") + ROWS, "no line MARKER_NAMES"),
        (_without("FREQUENCY") + ROWS, "FREQUENCY is 'absent'"),
        (_with("FREQUENCY\tfast") + ROWS, "FREQUENCY is 'fast'"),
        (_with("FREQUENCY\t0") + ROWS, "FREQUENCY is '0'"),
        (_with("NO_OF_MARKERS\t3") + ROWS, "NO_OF_MARKERS is 3 but there are 2"),
        (_with("MARKER_NAMES\ta\ta") + ROWS, "names 'a' twice"),
        (_with("MARKER_NAMES\ta\t\tb") + ROWS, "has an empty name"),
        (HEADER + ROWS[:1], "NO_OF_FRAMES is 2 but there are 1 rows"),
        ([*HEADER, ROWS[0], "1\t2\t3"], "row 14 has 3 columns, row 13 has 6"),
        ([*HEADER, "1\t2\t3\t4", "1\t2\t3\t4"], "row 13 has 4 columns; expected 3 for each of 2"),
        ([*HEADER, ROWS[0], "1\t2\tx\t4\t5\t6"], "row 14, column 3 is 'x'; expected a number"),
        ([*HEADER, ROWS[0], "1\t2\t3,5\t4\t5\t6"], "row 14, column 3 is '3,5'; export with a decimal point"),
        ([*HEADER, ROWS[0], "1\t2\tinf\t4\t5\t6"], "row 14, column 3 is 'inf'"),
        ([*HEADER, ROWS[0], "1\t2\t1e999\t4\t5\t6"], "row 14, column 3 is '1e999'"),
        (
            [*HEADER, *(row.replace(".", ",") for row in ROWS)],
            "row 13, column 1 is '-786,729'; export with a decimal point",
        ),
        (HEADER, "no row of numbers"),
        (_with("DATA_INCLUDED\t6D") + ROWS, "holds 6D"),
        ([*HEADER, "1,000.5\t2\t3\t4\t5\t6", ROWS[1]], "row 13, column 1 is '1,000.5'"),
        ([*HEADER, "MARKER_NAMES\ta\tb", *ROWS], "MARKER_NAMES is there twice"),
        ([*HEADER, "1\t" + ROWS[0], "2\t" + ROWS[1] + "\t1\t2\t3"], "row 14 has 10 columns"),
        ([*HEADER, "1\t0.0\t00:00:01:00\t1\t" + ROWS[0]], "NO_OF_FRAMES is 2"),
        ([*HEADER, "Frame\tTime\t" + AXES.replace("L", "R"), *ROWS], "titles are not those"),
        ([*HEADER, f"Frame\t{AXES}", *ROWS], "titles are not those"),
        ([*_without("NO_OF_FRAMES"), "1\t" + ROWS[0]], "row 12 has 7 columns"),
        (_with("FREQUENCY\tEXT") + ROWS, "export it with the column Time"),
        ([*_with("FREQUENCY\tEXT"), "1\t" + ROWS[0], "2\t" + ROWS[1]], "export it with the column Time"),
        (["NO_OF_BODIES\t1", "BODY_NAMES\trobot", *_without("MARKER_NAMES"), *ROWS], "export 3D data"),
    ],
)
def test_a_bad_file_is_answered_in_one_line(tmp_path, lines, words):
    path = _file(tmp_path, lines)
    with pytest.raises(InputError) as caught:
        read_mocap(path)
    message = str(caught.value)
    assert words in message and message.startswith(str(path)) and "\n" not in message


@pytest.mark.parametrize("name", ["mocap.tsv", "mocap.c3d"])
def test_files_that_are_not_there_or_of_another_kind(tmp_path, name):
    with pytest.raises(InputError, match="cannot be read|neither a file"):
        read_mocap(tmp_path / name)
    with pytest.raises(InputError, match="as .tsv or .c3d"):
        read_mocap(tmp_path / "mocap.mat")


_GOOD = ("\r\n".join(HEADER + ROWS) + "\r\n").encode()


@given(
    st.one_of(
        st.binary(max_size=80),
        st.tuples(st.integers(0, len(_GOOD)), st.binary(max_size=6), st.integers(0, 30)).map(
            lambda cut: _GOOD[: cut[0]] + cut[1] + _GOOD[cut[0] + cut[2] :]
        ),
        st.lists(st.sampled_from(["\t", "\n", "1", "-", ".", "e", "a", "NaN", '"', " ", ",", "\0"])).map(
            lambda parts: _GOOD[:-20] + "".join(parts).encode()
        ),
    )
)
@settings(max_examples=300, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_any_bytes_are_read_or_answered_with_an_input_error(tmp_path, content):
    path = tmp_path / "mocap.tsv"
    path.write_bytes(content)
    try:
        found = read_mocap(path)
    except InputError as error:
        assert len(str(error).splitlines()) == 1
    else:
        assert found.points_m.shape == (len(found.times_s), len(found.names), 3)
        assert not np.isinf(found.points_m).any()


def test_damaged_c3d_is_answered_in_one_line(tmp_path):
    mocap = MotionCapture(np.arange(99) / 100, ("a", "b"), np.ones((99, 2, 3)), 100.0)
    whole, path = tmp_path / "whole.c3d", tmp_path / "mocap.c3d"
    write_c3d(whole, mocap)
    raw = whole.read_bytes()
    for content in (b"", b"\x02", b"no C3D", raw[:600], raw[:-1000], b"\x02\x50" + bytes(2000)):
        path.write_bytes(content)
        with pytest.raises(InputError, match="C3D|cut off") as caught:
            read_mocap(path)
        assert "\n" not in str(caught.value)


def _c3d(tmp_path, n=9):
    path = tmp_path / "mocap.c3d"
    points_m = np.random.default_rng(0).uniform(-1, 1, (n, 2, 3))
    points_m[3, 1] = np.nan
    write_c3d(path, MotionCapture(np.arange(n) / 100, ("a", "b"), points_m, 100.0))
    return path, points_m


def test_missing_markers_of_a_c3d_are_marked(tmp_path):
    path, _ = _c3d(tmp_path)
    residuals = ezc3d.c3d(str(path))["data"]["meta_points"]["residuals"][0]
    assert residuals[1, 3] == -1 and (np.delete(residuals.ravel(), 9 + 3) == 0).all()


def test_rates_and_times_have_bounds(tmp_path):
    assert read_mocap(_file(tmp_path, _with("FREQUENCY\t100000") + ROWS)).rate_hz == 1e5
    with pytest.raises(InputError, match="FREQUENCY is '100001'"):
        read_mocap(_file(tmp_path, _with("FREQUENCY\t100001") + ROWS))
    for step_s, is_time in ((0.005 + 2.4e-5, True), (0.005 + 2.6e-5, False)):
        path = _file(tmp_path, [*HEADER, f"0.5\t{ROWS[0]}", f"{0.5 + step_s:.6f}\t{ROWS[1]}"])
        if is_time:
            assert read_mocap(path).times_s[0] == 0.5
        else:
            with pytest.raises(InputError, match="row 13 has 7 columns"):
                read_mocap(path)
    with pytest.raises(InputError, match="row 13 has 7 columns"):  # a time before the first frame
        read_mocap(_file(tmp_path, [*HEADER, f"-0.001\t{ROWS[0]}", f"0.004\t{ROWS[1]}"]))


def test_the_header_says_what_is_in_the_file(tmp_path):
    mocap = MotionCapture(np.array([0.25]), ("a", "b"), np.full((1, 2, 3), 0.5), 59.94)
    write_tsv(tmp_path / "mocap.tsv", mocap)
    assert (tmp_path / "mocap.tsv").read_text().splitlines() == [
        "NO_OF_FRAMES\t1", "NO_OF_CAMERAS\t0", "NO_OF_MARKERS\t2", "FREQUENCY\t59.94", "NO_OF_ANALOG\t0",
        "ANALOG_FREQUENCY\t0", "DESCRIPTION\t--", "DATA_INCLUDED\t3D", "MARKER_NAMES\ta\tb",
        "TRAJECTORY_TYPES\tMeasured\tMeasured", "Frame\tTime\ta X\ta Y\ta Z\tb X\tb Y\tb Z",
        "1\t0.25000" + 6 * "\t500.000",
    ]  # fmt: skip
