"""Figure of the registration: clicks, where solutions put the markers, and bars."""

import numpy as np
import pandas as pd
import pytest

from hicp_lib.core.camera import Camera
from hicp_lib.recordings.recording import open_recording
from hicp_lib.study.plots.mocap import registration
from tests.recordings.writing import RecordingWriter

METHODS = ["paper: eight clicks, camera marker", "all clicks"]


@pytest.fixture
def recording(tmp_path):
    writer = RecordingWriter(tmp_path / "room", Camera(160, 120, 150.0, 150.0, 79.5, 59.5))
    for k in range(3):
        writer.add(float(k), np.full((120, 160, 3), 90, np.uint8), np.ones((120, 160)), np.eye(4))
    writer.finish()
    return open_recording(writer.folder)


@pytest.fixture
def tables():
    rng = np.random.default_rng(0)
    clicks = pd.DataFrame({"frame": [0, 0, 2], "marker": ["a", "b", "a"]})
    clicks[["u_px", "v_px"]] = rng.uniform(40, 80, (3, 2))
    everywhere = pd.DataFrame([(f, m) for f in (0, 2) for m in "abc"], columns=["frame", "marker"])
    everywhere[["u_px", "v_px"]] = rng.uniform(40, 80, (6, 2))
    pixels = pd.concat([everywhere.assign(method=method) for method in METHODS])
    table = pd.DataFrame(
        {"method": METHODS, "n_points": [8, 90], "leave_one_out_m": [0.02, 0.01], "added_m": [0.04, 0.003]}
    )
    return clicks, pixels, table


def test_only_clicked_markers_are_drawn_and_bars_say_what_each_adds(recording, tables):
    figure = registration(recording, *tables, "made up")
    first, second, bars = figure.figure.axes
    assert [len(line.get_xdata()) for line in first.lines] == [2, 2, 2]
    assert [len(line.get_xdata()) for line in second.lines] == [1, 1, 1]
    assert [bar.get_width() for bar in bars.patches] == pytest.approx([40, 3])
    assert "all clicks 3 mm" in figure.alt and "truly are" in figure.caption and "made up" in figure.caption


def test_without_the_truth_the_bars_are_leave_one_out_errors(recording, tables):
    clicks, pixels, table = tables
    figure = registration(recording, clicks, pixels, table.assign(added_m=np.nan), "made up")
    assert [bar.get_width() for bar in figure.figure.axes[2].patches] == pytest.approx([20, 10])
    assert "all clicks 10 mm" in figure.alt and "truly" not in figure.caption
