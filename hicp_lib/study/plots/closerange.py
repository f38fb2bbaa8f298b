"""Figures of the network for close range: squares it learnt from, its training, what its parts are worth."""

import pandas as pd

from hicp_lib.core.images import read_image
from hicp_lib.study.closerange import FOLDER
from hicp_lib.study.plots import marks
from hicp_lib.study.plots.palette import STYLES
from hicp_lib.study.plots.people import picture_grid
from hicp_lib.study.plots.style import COLUMN_IN, WIDTH_IN, Figure, in_style, new_figure, texts

_CURVES = {"body": "bodies", "hand": "hands", "face": "faces", "in_picture_right": "in the picture or not"}
_STYLES = dict(zip(_CURVES, ("o-", "s--", "^:", "D-."), strict=True))


def squares() -> Figure:
    """Squares that it was trained on, with the truth."""
    picture = read_image(FOLDER / "squares.jpg")
    return picture_grid([[picture]], *texts("squares"), cell_in=COLUMN_IN)


@in_style
def training_curve(curve: pd.DataFrame) -> Figure:
    """Similarity of keypoints and share of right answers on bodies that were held back; from `trained`."""
    figure, axis = new_figure(1, 1, WIDTH_IN, 3.2)
    colours = STYLES["subsets"].values()
    pens = [*(style["color"] for style in colours), "#444444"]
    for (column, label), colour in zip(_CURVES.items(), pens, strict=True):
        axis.plot(curve["step"], curve[column], _STYLES[column], color=colour, label=label, ms=4)
    axis.set(xlabel="steps of training", ylabel="share right", ylim=(0, 1.02))
    marks.legend_below(figure, axis)
    ends = curve.iloc[[-1]].to_dict("records")[0]
    said = pd.Series({label: ends[column] for column, label in _CURVES.items()})
    return Figure(figure, *texts("training_curve", said=said, steps=int(ends["step"])), curve)


@in_style
def ablations(table: pd.DataFrame) -> Figure:
    """Average precision of variants; `table` from `trained`, columns `variant, subset, group` and bounds."""
    return _variants("ablations", table)


@in_style
def resolutions(table: pd.DataFrame) -> Figure:
    """Average precision in enlarged pictures; `table` as of `ablations`."""
    return _variants("resolutions", table)


def _variants(name: str, table: pd.DataFrame) -> Figure:
    pens = marks.subset_dots(table["subset"].unique())
    figure, _, panels = marks.dot_chart(table, "variant", "subset", pens, WIDTH_IN, ["group"])
    for axis, _, group in panels:
        axis.set(xlabel="average precision")
        axis.set_title({"body": "bodies", "hand": "both hands"}[group])
    return Figure(figure, *texts(name, said=table[table["variant"] == table["variant"].iloc[0]]), table)
