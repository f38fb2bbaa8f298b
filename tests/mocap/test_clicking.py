"""Clicked markers: written, read back, and refused where they cannot be."""

import base64

import cv2
import numpy as np
import pytest

from hicp_lib.core.camera import Camera
from hicp_lib.core.errors import InputError
from hicp_lib.mocap.clicking import CLICKS_FILE, read_clicks, record_click, show_frame
from hicp_lib.recordings.recording import open_recording, read_rgb
from tests.recordings.writing import RecordingWriter

MARKERS = ("elbow_left_1", "wrist_right_2")


@pytest.fixture
def recording(tmp_path):
    writer = RecordingWriter(tmp_path / "room", Camera(32, 24, 30.0, 30.0, 15.5, 11.5))
    picture = np.random.default_rng(0).integers(0, 255, (24, 32, 3), dtype=np.uint8)
    for k in range(3):
        writer.add(float(k), picture, np.ones((24, 32)), np.eye(4))
    writer.finish()
    return open_recording(writer.folder)


def test_clicks_are_written_one_by_one_and_corrected(recording):
    record_click(recording, MARKERS, 1, "elbow_left_1", 3.5, 4)
    record_click(recording, MARKERS, 1, "wrist_right_2", 10, 11.25)
    clicks = record_click(recording, MARKERS, 1, "elbow_left_1", 5.0, 6.0)
    read = read_clicks(recording.folder / CLICKS_FILE, recording, MARKERS)
    assert read.equals(clicks)
    assert read.to_dict("list") == {
        "frame": [1, 1], "marker": ["wrist_right_2", "elbow_left_1"], "u_px": [10, 5], "v_px": [11.25, 6],
    }  # fmt: skip


@pytest.mark.parametrize(
    "rows, said",
    [
        ("3,elbow_left_1,1,1", "row 2: frame is 3; expected a whole number from 0 to 2"),
        ("0.5,elbow_left_1,1,1", "row 2: frame is 0.5"),
        ("0,elbow_left_1,1,1\n0,nose,1,1", "row 3: marker 'nose' is not in the motion capture"),
        ("0,elbow_left_1,32,1", "row 2: u_px is 32; expected a pixel from 0 to 31"),
        ("0,elbow_left_1,1,", "row 2: v_px is nan"),
        ("0,elbow_left_1,1,1\n0,elbow_left_1,2,2", "row 3: elbow_left_1 is clicked twice"),
        ("0,elbow_left_1,left,1", "row 2: u_px is 'left'"),
        ("", "has no rows"),
    ],
)
def test_wrong_rows_are_named_in_one_line(recording, rows, said):
    path = recording.folder / CLICKS_FILE
    path.write_text(f"frame,marker,u_px,v_px\n{rows}\n")
    with pytest.raises(InputError) as error:
        read_clicks(path, recording, MARKERS)
    assert said in str(error.value) and str(path) in str(error.value) and "\n" not in str(error.value)


@pytest.mark.parametrize("content", [b"", b"frame,marker,u_px\n1,a,2\n", b"\xff\xfe\x00", b'a,b\n"1,2\n'])
def test_other_files_are_refused_in_one_line(recording, content):
    path = recording.folder / CLICKS_FILE
    path.write_bytes(content)
    with pytest.raises(InputError, match="expected a table with frame, u_px, v_px, marker"):
        read_clicks(path, recording, MARKERS)
    with pytest.raises(InputError, match="cannot be read"):
        read_clicks(path.with_name("none.csv"), recording, MARKERS)


def test_a_wrong_click_is_not_written(recording):
    with pytest.raises(InputError, match="click: marker 'nose'"):
        record_click(recording, MARKERS, 0, "nose", 1, 1)
    assert not (recording.folder / CLICKS_FILE).exists()


def test_the_image_shown_is_the_frame_with_its_clicks(recording):
    clicks = record_click(recording, MARKERS, 1, "elbow_left_1", 3.5, 4)
    figure = show_frame(recording, 1, clicks)
    image, marks = figure.data
    encoded = base64.b64decode(image.source.split(",")[1])
    shown = cv2.cvtColor(cv2.imdecode(np.frombuffer(encoded, np.uint8), cv2.IMREAD_COLOR), cv2.COLOR_BGR2RGB)
    assert np.array_equal(shown, read_rgb(recording, 1))
    assert (list(marks.x), list(marks.y), list(marks.text)) == ([3.5], [4.0], ["elbow_left_1"])
    assert len(show_frame(recording, 0, clicks).data[1].x) == 0


@pytest.mark.parametrize(
    ("u_px", "v_px", "fits"),
    [(-0.5, -0.5, True), (31.49, 23.49, True), (-0.51, 0, False), (31.5, 0, False), (0, 23.5, False)],
)
def test_a_click_is_on_a_pixel_of_the_image(recording, u_px, v_px, fits):
    if fits:
        assert record_click(recording, MARKERS, 0, "elbow_left_1", u_px, v_px)["u_px"].tolist() == [u_px]
    else:
        with pytest.raises(InputError, match="expected a pixel from 0 to (31|23)"):
            record_click(recording, MARKERS, 0, "elbow_left_1", u_px, v_px)


@pytest.mark.parametrize(("frame", "fits"), [(0, True), (2, True), (-1, False), (3, False), (True, False)])
def test_a_click_is_in_a_frame_of_the_recording(recording, frame, fits):
    if fits:
        assert record_click(recording, MARKERS, frame, "elbow_left_1", 1, 1)["frame"].tolist() == [frame]
    else:
        with pytest.raises(InputError, match="expected a whole number from 0 to 2"):
            record_click(recording, MARKERS, frame, "elbow_left_1", 1, 1)
