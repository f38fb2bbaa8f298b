"""What charts are put together from, each at known places."""

import numpy as np
import pandas as pd
import pytest

from hicp_lib.study.plots import marks
from hicp_lib.study.plots.palette import DETECTOR_STYLES, OTHER_COLOUR, detector_colour, detector_marker
from hicp_lib.study.plots.style import in_words, new_figure, series_text


def test_each_axis_gets_its_rows_and_says_whose_they_are():
    table = pd.DataFrame({"group": ["hand", "body", "hand"], "subset": ["b", "a", "a"], "value": [1, 2, 3]})
    _, axes, panels = marks.panels(table, ["group", "subset"], 4.0, 3.0)
    found = {(down, across): (axis, rows["value"].tolist()) for axis, rows, down, across in panels}
    assert {case: values for case, (_, values) in found.items()} == {
        ("hand", "b"): [1], ("hand", "a"): [3], ("body", "b"): [], ("body", "a"): [2],
    }  # fmt: skip
    assert found["hand", "a"][0] is axes[0, 1] and found["body", "b"][0] is axes[1, 0]


def test_panels_of_one_column_stand_side_by_side_and_there_is_one_without_rows():
    table = pd.DataFrame({"view": ["b", "a", "b"]})
    _, axes, panels = marks.panels(table, ["view"], 4.0, 3.0)
    assert axes.shape == (1, 2) and [(view, len(rows)) for _, rows, view in panels] == [("b", 2), ("a", 1)]
    _, axes, panels = marks.panels(table[:0], ["view"], 4.0, 3.0)
    assert axes.shape == (1, 1) and panels == []


def test_panels_of_one_column_are_wrapped_and_what_is_left_stays_empty():
    table = pd.DataFrame({"joint": list("abc")})
    _, axes, panels = marks.panels(table, ["joint"], 4.0, 3.0, wrap=2)
    assert axes.shape == (2, 2) and [axis for axis, *_ in panels] == list(axes.flat[:3])
    assert [axis.axison for axis in axes.flat] == [True, True, True, False]


def test_whiskers_reach_to_the_interval_and_never_the_wrong_way():
    rows = pd.DataFrame({"v": [2.0, 5.0, 0.5, np.nan], "l": 1.0, "h": [4.0, 4.0, 4.0, 4.0]})
    below, above = marks.whiskers(rows, "v", "l", "h")
    np.testing.assert_array_equal(below, [1.0, 4.0, 0.0, np.nan])
    np.testing.assert_array_equal(above, [2.0, 0.0, 3.5, np.nan])


def test_dots_of_a_row_stand_beside_each_other_in_their_detectors_colours():
    _, axis = new_figure()
    rows = pd.DataFrame({"part": ["b", "a", "b"], "detector": ["posenet", "posenet", "mmpose"]})
    rows = rows.assign(v=[0.5, 0.25, 0.125], l=0.0, h=1.0)
    pens = marks.detector_dots(["posenet", "mmpose"])
    marks.dots_in_rows(axis, rows, "part", "detector", ["a", "b"], pens, bounds=("v", "l", "h"), factor=100)
    posenet, mmpose = (bars.lines[0] for bars in axis.containers)
    assert posenet.get_xydata().tolist() == [[50, 0.8], [25, -0.2]]
    assert mmpose.get_xydata().tolist() == [[12.5, 1.2]]
    assert [(dots.get_color(), dots.get_marker()) for dots in (posenet, mmpose)] == [
        DETECTOR_STYLES["posenet"], DETECTOR_STYLES["mmpose"],
    ]  # fmt: skip
    ends = axis.containers[1].lines[2][0].get_segments()[0]
    assert ends.tolist() == [[0, 1.2], [100, 1.2]]


def test_bars_lie_end_to_end_in_the_order_of_the_styles():
    _, axis = new_figure()
    lengths = pd.DataFrame({"b": [1.0, 2.0], "a": [3.0, np.nan], "not drawn": 9.0})
    marks.stacked_bars(axis, lengths, {"a": {"color": "red"}, "b": {"color": "blue"}})
    assert [(bar.get_x(), bar.get_width()) for bar in axis.patches[::2]] == [(0, 3), (3, 1)]
    assert [bars.get_label() for bars in axis.containers] == ["a", "b"]


def test_names_of_rows_begin_on_top():
    _, axis = new_figure()
    marks.name_rows(axis, ["x", "y", "z"])
    assert [text.get_text() for text in axis.get_yticklabels()] == ["x", "y", "z"]
    assert axis.get_yticks().tolist() == [0, 1, 2] and axis.get_ylim() == (2.5, -0.5)


def test_a_legend_has_each_label_once():
    figure, axes = new_figure(1, 2)
    for axis in axes:
        axis.plot([0, 1], label="mediapipe")
    axes[1].plot([1, 0], label="mmpose")
    marks.legend_below(figure, axes)
    (legend,) = figure.legends
    assert [text.get_text() for text in legend.get_texts()] == ["mediapipe", "mmpose"]


@pytest.mark.parametrize("label", ["a", "mediapipe", "movenet-multipose, lower", "x" * 40])
def test_a_legend_is_no_wider_than_its_figure(label):
    figure, axis = new_figure(1, 1, 5.5, 3.0, layout="constrained")
    for k in range(8):
        axis.plot([0, 1], label=f"{label} {k}")
    marks.legend_below(figure, axis)
    figure.canvas.draw()
    width_px = figure.legends[0].get_window_extent().width
    assert width_px <= figure.bbox.width < 3 * width_px


def test_lines_of_a_legend_have_the_detectors_colours_and_no_points():
    _, axis = new_figure()
    marks.add_keys(axis, ["mediapipe", "unheard of"], {"OKS .5": {"marker": "s", "ls": ""}})
    mediapipe, other, square = axis.lines
    assert (mediapipe.get_color(), other.get_color()) == (DETECTOR_STYLES["mediapipe"][0], OTHER_COLOUR)
    assert (square.get_label(), square.get_marker(), len(square.get_xdata())) == ("OKS .5", "s", 0)


def test_a_box_is_of_quartiles_and_its_whiskers_of_the_5th_and_95th_percentile():
    _, axis = new_figure()
    marks.draw_boxes(axis, [pd.Series(np.arange(101.0))], ["red"], positions=[2])
    (box,) = axis.patches
    assert sorted(set(box.get_path().vertices[:5, 0])) == [25, 75]
    ends = {x for line in axis.lines for x in np.asarray(line.get_xdata(), float)}
    assert {5.0, 95.0, 50.0} <= ends and max(ends) == 95 and box.get_facecolor()[:3] == (1, 0, 0)


@pytest.mark.parametrize(
    ("name", "like"),
    [
        ("mmpose-imported", "mmpose"),
        ("mediapipe-pose-imported", "mediapipe-pose"),
        ("combined:openpose+mediapipe", "combined"),
        ("combined:movenet-thunder+mediapipe-hands", "combined:movenet-thunder"),
        ("openpose-mobilenet", "openpose-mobilenet"),
    ],
)
def test_variants_have_their_detectors_colour(name, like):
    assert (detector_colour(name), detector_marker(name)) == DETECTOR_STYLES[like]


def test_a_name_that_begins_alike_is_another_detector():
    assert detector_colour("mmposer") == OTHER_COLOUR


def test_a_series_in_words_names_all_labels():
    index = pd.MultiIndex.from_tuples([("a", "x"), ("b", "y")])
    assert series_text(pd.Series([0.25, 0.5], index), "{0} {2:.0%} in {1}") == "a 25% in x and b 50% in y"
    assert series_text(pd.Series([], dtype=float)) == in_words([]) == "nothing"
    assert in_words(str(n) for n in range(3)) == "0, 1 and 2"
