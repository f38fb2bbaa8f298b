"""Figure of the registration: markers clicked, where each solution puts them, what each adds to errors."""

from __future__ import annotations

import numpy as np
import pandas as pd
from matplotlib.patheffects import withStroke

from hicp_lib.recordings.recording import Recording, read_rgb
from hicp_lib.study.plots.style import Figure, in_style, in_words, new_figure

# Solutions in the order they are given; not detectors' colours.
_STYLES = (("#D5272D", "x"), ("#F0A202", "+"), ("#19B5FE", "1"), ("#2ECC40", "2"))
_MARGIN_PX = 45
# White on a picture, and to be seen on the page as well.
_OUTLINED = [withStroke(linewidth=3, foreground="#333333")]


@in_style
def registration(
    recording: Recording, clicks: pd.DataFrame, pixels: pd.DataFrame, table: pd.DataFrame, note: str
) -> Figure:
    """Images with the clicked markers and where every registration puts the measured ones, over a bar chart.

    Parameters
    ----------
    clicks : those of the images shown, columns `frame, marker, u_px, v_px`
    pixels : as from `marker_pixels`; only markers that were clicked are drawn
    table : as from `compare_registrations`
    """
    frames, methods = sorted(set(clicks["frame"])), list(table["method"])
    figure, axes = new_figure(1, len(frames) + 1, 4.2 * len(frames) + 4.0, 4.4)
    shown = clicks[["frame", "marker"]].merge(pixels, on=["frame", "marker"])
    for axis, frame in zip(axes, frames, strict=False):
        _draw_markers(axis, recording, frame, clicks[clicks["frame"] == frame], shown, methods)
    known = bool(table["added_m"].notna().any())
    _draw_bars(axes[-1], table, "added_m" if known else "leave_one_out_m", known)
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=4, fontsize=9)
    what = (
        "how far it puts the person's markers from where they truly are, median over markers and frames"
        if known
        else "the median error of a marker under the fit of the others"
    )
    caption = (
        "Registration of motion capture to the robot: markers clicked in images (circles), where each "
        f"solution puts them (crosses), and {what}: {note}."
    )
    column = "added_m" if known else "leave_one_out_m"
    values = table.dropna(subset=[column])
    said = in_words(
        [f"{name} {1000 * v:.0f} mm" for name, v in zip(values["method"], values[column], strict=True)]
    )
    return Figure(figure, caption, f"Images with markers, and bars: {said}.", table)


def _draw_markers(axis, recording: Recording, frame: int, clicks, pixels: pd.DataFrame, methods) -> None:
    axis.imshow(read_rgb(recording, frame))
    axis.plot(
        clicks["u_px"], clicks["v_px"], "o", color="white", mfc="none", mew=1.5, markersize=11,
        path_effects=_OUTLINED, label="clicked",
    )  # fmt: skip
    for method, (colour, shape) in zip(methods, _STYLES, strict=False):
        part = pixels[(pixels["method"] == method) & (pixels["frame"] == frame)]
        axis.plot(part["u_px"], part["v_px"], shape, color=colour, mew=1.8, markersize=9, label=method)
    low = clicks[["u_px", "v_px"]].min().to_numpy() - _MARGIN_PX
    high = clicks[["u_px", "v_px"]].max().to_numpy() + _MARGIN_PX
    size = [recording.intrinsics.width_px, recording.intrinsics.height_px]
    (left, top), (right, bottom) = np.maximum(low, 0), np.minimum(high, size)
    axis.set(xlim=(left, right), ylim=(bottom, top), xticks=[], yticks=[], title=f"frame {frame}")
    axis.grid(False)


def _draw_bars(axis, table: pd.DataFrame, column: str, known: bool) -> None:
    for y, (row, (colour, _)) in enumerate(zip(table.to_dict("records"), _STYLES, strict=False)):
        axis.barh(y, 1000 * row[column], color=colour, height=0.55)
    axis.set(yticks=range(len(table)), yticklabels=[name.replace(": ", ":\n") for name in table["method"]])
    axis.set(
        ylim=(len(table) - 0.5, -0.5), xlabel="added error [mm]" if known else "leave-one-out error [mm]"
    )
    axis.grid(axis="y", visible=False)
