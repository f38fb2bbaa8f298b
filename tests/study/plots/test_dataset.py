"""Layouts of keypoints: their points are counted and drawn."""

from hicp_lib.core.datafiles import DATA_DIR
from hicp_lib.core.files import read_json
from hicp_lib.core.keypoints import TO_HALPE
from hicp_lib.study.plots.dataset import layouts


def test_every_layout_has_a_person_with_the_points_that_have_a_counterpart():
    figure, made_of = layouts(), read_json(DATA_DIR / "survey.json")["layouts"]
    assert figure.table["points"].tolist() == [17, 25 + 42 + 70, 17 + 6 + 68 + 42, 26 + 68 + 42, 33 + 42]
    for axis, conventions in zip(figure.figure.axes, made_of.values(), strict=False):
        n_drawn = sum(len(line.get_xdata()) for line in axis.lines if line.get_marker() != "None")
        assert n_drawn == sum(int((TO_HALPE[name] >= 0).sum()) for name in conventions)
    hand = figure.figure.axes[-1]
    assert sum(len(line.get_xdata()) for line in hand.lines if line.get_marker() != "None") == 21
    markers = {line.get_marker() for axis in figure.figure.axes for line in axis.lines} - {"None"}
    assert len(markers) == 4
    assert "MMPose: COCO-WholeBody 133" in figure.alt


def test_the_person_faces_the_reader():
    body = layouts().figure.axes[0].lines
    points = next(line for line in body if line.get_marker() == "o")
    left_shoulder, right_shoulder = points.get_xdata()[5:7]
    assert left_shoulder > right_shoulder
