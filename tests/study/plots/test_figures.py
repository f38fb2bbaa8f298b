"""Figures: what they carry, and that what is drawn is where it belongs."""

from itertools import combinations

import matplotlib as mpl
import numpy as np
import pandas as pd
import pytest

from hicp_lib.core.detections import Detections
from hicp_lib.core.images import write_png
from hicp_lib.detectors.registry import DETECTORS, default_detector_names
from hicp_lib.evaluation.ap.found_and_placed import found_and_placed
from hicp_lib.evaluation.statistics.resampling import Draws
from hicp_lib.study.plots import evaluation, people
from hicp_lib.study.plots.one_person import example
from hicp_lib.study.plots.palette import DETECTOR_STYLES, detector_colour
from hicp_lib.study.plots.style import Figure, in_style, in_words, new_figure
from tests.evaluation.made_people import make_annotations

METRICS = ("AP", "AP50", "AP75", "AR", "AR50", "AR75")


@pytest.fixture
def metrics() -> pd.DataFrame:
    rng = np.random.default_rng(0)
    rows = [
        (subset, group, detector, metric, value := rng.uniform(0.2, 0.8), value - 0.1, value + 0.1)
        for subset in ("basic", "headless")
        for group in ("body", "hand")
        for detector in ("mediapipe", "openpose-mobilenet")
        for metric in METRICS
    ]
    return pd.DataFrame(rows, columns=["subset", "group", "detector", "metric", "value", "low", "high"])


@pytest.mark.parametrize(("flag", "is_drawn"), [(2, True), (1, True), (0.4, True), (0, False)])
def test_what_is_labelled_is_drawn_hidden_or_not(flag, is_drawn, tmp_path):
    write_png(tmp_path / "1.png", np.zeros((60, 60, 3), np.uint8))
    points, flags = np.full((1, 136, 2), 30.0), np.zeros((1, 136))
    flags[0, 5] = flag
    truth = make_annotations(points, [1], visibility=flags)
    drawn = people.draw_truth(truth, tmp_path, 1, truth.ids == 1, "#FFFFFF")
    assert drawn.any() == is_drawn
    assert not people.draw_truth(truth, tmp_path, 1, truth.ids == 1, "#FFFFFF", n_keypoints=5).any()


@pytest.mark.parametrize("draw", [evaluation.precision_recall, evaluation.loss_without_head])
def test_comparison_figures_say_on_what_data_and_what_they_show(metrics, draw):
    figure = draw(metrics, "made-up people")
    assert "made-up people" in figure.caption
    assert "mediapipe" in figure.alt and len(figure.alt) < 600
    assert len(figure.table)
    for axis in figure.figure.axes:
        assert axis.has_data()


def test_alt_text_names_the_best_detector(metrics):
    metrics.loc[(metrics["detector"] == "openpose-mobilenet") & (metrics["metric"] == "AP"), "value"] = 0.99
    assert "openpose-mobilenet with 0.99 (basic body)" in evaluation.precision_recall(metrics, "x").alt


def test_the_axes_of_a_group_begin_below_its_lowest_interval(metrics):
    hands = metrics["group"] == "hand"
    metrics.loc[hands, ["value", "low", "high"]] = [0.75, 0.65, 0.85]
    metrics.loc[~hands, ["value", "low", "high"]] = np.nan  # nobody counts
    axes = evaluation.precision_recall(metrics, "x").figure.axes
    assert [axis.get_xlim()[0] for axis in axes] == pytest.approx([0, 0.6, 0, 0.6])


def test_detectors_are_told_apart_without_colours(metrics):
    table = metrics.assign(oks=metrics["value"])
    for figure in (evaluation.precision_recall(metrics, "x"), evaluation.oks_curves(table, "x")):
        axis = figure.figure.axes[0]
        lines = [line for line in axis.get_lines() if line.get_marker() not in ("None", "")]
        shapes = {(line.get_marker(), line.get_color()) for line in lines if len(line.get_xdata())}
        assert shapes == {DETECTOR_STYLES[name][::-1] for name in ("mediapipe", "openpose-mobilenet")}


def test_an_example_has_the_truth_and_says_who_is_not_found(tmp_path):
    write_png(tmp_path / "1.png", np.zeros((60, 60, 3), np.uint8))
    truth = make_annotations(np.full((1, 136, 2), 30.0), [1])
    there = Detections(np.full((1, 136, 2), 30.0), np.ones((1, 136)), np.ones(1))
    oks = pd.DataFrame(
        {"group": "body", "detector": ["posenet", "mmpose"], "image_id": 1, "oks": [0.87, 0.0]}
    )
    figure = example(tmp_path, truth, 1, {"posenet": {1: there}, "mmpose": {}}, oks, "made-up people")
    titles = [axis.get_title(loc="center") for axis in figure.figure.axes]
    assert titles == ["annotated", "posenet\nOKS 0.87", "mmpose\nnothing found"]
    assert all(axis.images for axis in figure.figure.axes)
    assert "posenet: OKS 0.87 and mmpose: nothing found" in figure.alt


@pytest.mark.parametrize("oks", [[0.0, 0.05], [0.0, 0.95], [0.5, 0.95]], ids=["nobody", "one", "both"])
def test_found_and_placed_are_side_by_side_for_who_is_found(oks):
    parts = [
        pd.DataFrame(
            {"subset": subset, "group": "body", "detector": "posenet", "oks": of, "source_image": [1, 2]}
        )
        for subset, of in (("basic", [0.9, 0.9]), ("headless", oks))
    ]
    table = found_and_placed(pd.concat(parts), Draws(10))
    figure = evaluation.found_and_placed(table, "made-up people")
    found, placed = ([line.get_xdata()[0] for line in axis.get_lines() if line.get_marker() == "o"
                      and len(line.get_xdata()) == 1] for axis in figure.figure.axes)  # fmt: skip
    of_found = [value for value in oks if value >= 0.1]
    share = len(of_found) / len(oks)
    assert found == pytest.approx([1.0, share])
    assert placed == pytest.approx([0.9, sum(of_found) / len(of_found)] if of_found else [0.9])
    assert f"posenet {share:.0%} (headless body)" in figure.alt


def test_the_share_of_people_falls_with_oks():
    table = pd.DataFrame(
        {"subset": "basic", "group": "body", "detector": "mediapipe", "oks": [0, 0.5, 0.9, 1.0]}
    )
    line = evaluation.oks_curves(table, "x").figure.axes[0].get_lines()[0]
    heights = np.array(line.get_ydata())
    assert heights[0] == 0.75 and heights[-1] == 0 and (np.diff(heights) <= 0).all()


def test_times_are_in_milliseconds_from_zero():
    table = pd.DataFrame({"detector": ["mediapipe"] * 5, "time_ms": [10.0, 11, 12, 13, 14]})
    figure = evaluation.time_per_image(table, "alone")
    assert figure.figure.axes[0].get_xlabel().endswith("[ms]") and figure.figure.axes[0].get_xlim()[0] == 0
    assert "mediapipe 12 ms" in figure.alt


def test_grids_have_a_picture_per_detector_and_room_for_missing_ones():
    image = np.full((40, 30, 3), 90, np.uint8)
    found = {"mediapipe": Detections.none(), "openpose-mobilenet": Detections.none()}
    figure = people.detections_grid({"one": (image, found), "two": (image, found)}, 0.3)
    assert sum(len(axis.images) for axis in figure.figure.axes) == 4
    alone = people.detections_grid({"one": (image, dict.fromkeys(("a", "b+c", "d"), Detections.none()))}, 0.3)
    titles = [axis.get_title(loc="center") for axis in alone.figure.axes]
    assert titles == ["a", "b\n+c", "d", ""] and [len(axis.images) for axis in alone.figure.axes] == [
        1,
        1,
        1,
        0,
    ]
    sparse = people.picture_grid([[image, None]], "c", "a")
    assert [len(axis.images) for axis in sparse.figure.axes] == [1, 0]


def test_drawing_leaves_matplotlib_as_it_was(metrics):
    before = dict(mpl.rcParams)
    assert isinstance(evaluation.precision_recall(metrics, "x"), Figure)
    assert dict(mpl.rcParams) == before


# Linear RGB as eyes without red or green cones have it (Machado et al. 2009), and without a lack.
_EYES = {
    "all cones": np.eye(3),
    "no red": [[0.152, 1.053, -0.205], [0.115, 0.786, 0.099], [-0.004, -0.048, 1.052]],
    "no green": [[0.367, 0.861, -0.228], [0.280, 0.673, 0.047], [-0.012, 0.043, 0.969]],
}
_SHOWN_TOGETHER = (*default_detector_names()[2:], "combined:movenet-thunder+mediapipe-hands")


def _as_seen(colour: str, eyes: str) -> np.ndarray:
    """OKLab, in which equal distances look alike."""
    linear = np.array([((c + 0.055) / 1.055) ** 2.4 for c in mpl.colors.to_rgb(colour)])
    to_cones = [[0.4122, 0.5363, 0.0514], [0.2119, 0.6807, 0.1074], [0.0883, 0.2817, 0.63]]
    to_lab = [[0.2105, 0.7936, -0.0041], [1.978, -2.4286, 0.4506], [0.0259, 0.7828, -0.8087]]
    return np.array(to_lab) @ np.cbrt(np.array(to_cones) @ np.clip(np.array(_EYES[eyes]) @ linear, 0, 1))


def test_every_detector_has_a_colour_and_a_marker_of_its_own():
    assert DETECTORS.keys() < DETECTOR_STYLES.keys()
    assert all(
        len(set(column)) == len(DETECTOR_STYLES) for column in zip(*DETECTOR_STYLES.values(), strict=True)
    )
    assert detector_colour("mmpose-imported") == DETECTOR_STYLES["mmpose"][0]
    assert detector_colour("something else") not in {colour for colour, _ in DETECTOR_STYLES.values()}


@pytest.mark.parametrize("eyes", _EYES)
def test_the_default_detectors_stay_apart_for_the_colour_blind(eyes):
    seen = [_as_seen(detector_colour(name), eyes) for name in _SHOWN_TOGETHER]
    assert min(np.linalg.norm(a - b) for a, b in combinations(seen, 2)) > 0.08


@pytest.mark.parametrize(("items", "text"), [([], "nothing"), (["a"], "a"), (["a", "b", "c"], "a, b and c")])
def test_words(items, text):
    assert in_words(items) == text


def test_a_name_with_dollars_is_drawn_as_it_is(tmp_path):
    @in_style
    def draw() -> Figure:
        figure, axes = new_figure(1, 1, 2.0, 2.0)
        axes.set_title("$\\nothing{$")
        figure.savefig(tmp_path / "a.svg")
        return Figure(figure, "", "")

    draw()
    assert "$\\nothing{$" in (tmp_path / "a.svg").read_text()
