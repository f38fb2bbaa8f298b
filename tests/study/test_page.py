"""What a notebook saves: figures with words, tables with their parameters, numbers that are finite."""

from __future__ import annotations

import json

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest

from hicp_lib.detectors.weights.default import registry
from hicp_lib.study.page import Study
from hicp_lib.study.plots import Figure
from hicp_lib.study.provenance import lock_sha256


@pytest.fixture
def shown(monkeypatch) -> list[str]:
    """The HTML that a notebook would show."""
    pieces: list[str] = []

    def show(piece, raw=False):
        pieces.append(piece["text/html"] if raw else piece.data)

    monkeypatch.setattr("hicp_lib.study.page.display", show)
    return pieces


@pytest.fixture
def study(tmp_path, monkeypatch) -> Study:
    monkeypatch.setenv("HICP_RESULTS", str(tmp_path))
    monkeypatch.setenv("HICP_PROFILE", "quick")
    return Study("07_x", seed=np.int64(3), images=tmp_path)


def line_figure() -> Figure:
    figure, axis = plt.subplots()
    axis.plot([0, 1])
    plt.close(figure)
    return Figure(figure, "A <caption>", 'Says "up"', pd.DataFrame({"x_px": [1.5]}))


def test_a_figure_is_shown_with_its_words_and_saved_the_same_each_time(study, shown):
    study.figure("line", line_figure())
    assert 'alt="Says &#34;up&#34;"' in shown[0]
    assert "<figcaption>A &#60;caption&#62;" in shown[0]
    assert 'href="../results/quick/07_x/line.csv"' in shown[0]
    first = {kind: (study.folder / f"line.{kind}").read_bytes() for kind in ("svg", "webp", "csv")}
    study.figure("line", line_figure())
    assert first == {kind: (study.folder / f"line.{kind}").read_bytes() for kind in first}


def test_a_picture_is_saved_small_and_without_numbers(study, shown):
    line = line_figure()
    study.figure("photo", Figure(line.figure, line.caption, line.alt))
    assert [path.name for path in study.folder.iterdir()] == ["photo.webp"]
    assert 'src="data:image/webp;base64,' in shown[0]
    assert (study.folder / "photo.webp").read_bytes()[8:12] == b"WEBP"


def test_a_table_is_saved_exactly_with_the_parameters_of_its_run(study, shown):
    table = pd.DataFrame({"detector": ["a", "b"], "oks": [1 / 3, np.nan]})
    study.table("t", table, "A table.")
    assert "0.333" in shown[0]
    assert "–" in shown[0]
    path = study.folder / "t.parquet"
    pd.testing.assert_frame_equal(pd.read_parquet(path), table)
    stamp = json.loads(pq.read_schema(path).metadata[b"hicp"])
    assert stamp["parameters"]["seed"] == 3


def test_a_table_may_be_shown_in_short_and_is_saved_whole(study, shown):
    table = pd.DataFrame({"detector": ["a"], "value": [0.25], "low": [0.125]})
    study.table("t", table, "A table.", shown=pd.DataFrame({"detector": ["a"], "AP": ["0.25 [0.12, 0.5]"]}))
    assert "0.25 &#91;0.12, 0.5&#93;" in shown[0] and ">low<" not in shown[0]
    pd.testing.assert_frame_equal(pd.read_parquet(study.folder / "t.parquet"), table)


def test_values_are_json_and_finite(study, shown):
    study.value("n", np.int64(3))
    study.value("many", np.array([1.5, 2]))
    study.value("absent", None)
    for bad in (float("nan"), np.inf, [1.0, np.nan], {"a": np.float32("nan")}):
        with pytest.raises(ValueError, match="record None for what was not measured"):
            study.value("bad", bad)
    study.finish()
    values = json.loads((study.folder / "values.json").read_text())
    assert values == {"n": 3, "many": [1.5, 2.0], "absent": None}


def test_the_stamp_says_what_was_run(study, shown, tmp_path):
    study.finish()
    stamp = json.loads((study.folder / "provenance.json").read_text())
    assert stamp["notebook"] == "07_x"
    assert stamp["parameters"] == {"seed": 3, "images": str(tmp_path)}
    assert stamp["lock_sha256"] == lock_sha256()
    assert stamp["weights_sha256"] == {weight.name: weight.sha256 for weight in registry().values()}
    assert stamp["versions"]["numpy"] == np.__version__
    assert stamp["machine"]["cores"] >= 1
    assert 20 < stamp["peak_memory_mb"] < 100_000
    assert "seed = 3" in shown[0]
    assert stamp["lock_sha256"][:12] in shown[0]


def test_a_scene_is_described_and_carries_no_library_of_its_own(study, shown):
    import plotly.graph_objects as go

    study.scene("s", go.Figure(go.Scatter3d(x=[0], y=[0], z=[0])), "A scene.", 'One "point"')
    assert 'aria-label="One &#34;point&#34;"' in shown[0]
    assert len(shown[0]) < 50_000
    assert json.loads((study.folder / "s.json").read_text())["data"][0]["type"] == "scatter3d"
