"""Figure of the registration: markers clicked, where each solution puts them, what each adds to errors."""

import numpy as np
import pandas as pd
from matplotlib.patheffects import withStroke

from hicp_lib.recordings.recording import Recording, read_rgb
from hicp_lib.study.plots import marks
from hicp_lib.study.plots.style import Figure, in_style, new_figure, series_text, texts

# Solutions in the order they are given; not detectors' colours.
_STYLES = (("#D5272D", "x"), ("#FF69B4", "3"), ("#F0A202", "+"), ("#19B5FE", "1"), ("#2ECC40", "2"))
_MARGIN_PX = 45
_ADDED, _LEAVE_ONE_OUT = ("added_m", "added error [mm]"), ("leave_one_out_m", "leave-one-out error [mm]")
# White on a picture, and to be seen on the page as well.
_OUTLINED = [withStroke(linewidth=3, foreground="#333333")]


@in_style
def registration(
    recording: Recording, clicks: pd.DataFrame, pixels: pd.DataFrame, table: pd.DataFrame, note: str
) -> Figure:
    """Images with the clicked markers and where every registration puts the measured ones, over a bar chart.

    Parameters
    ----------
    recording : Recording
    clicks : pd.DataFrame
        Those of the images shown, columns `frame, marker, u_px, v_px`.
    pixels : pd.DataFrame
        As from `marker_pixels`; only markers that were clicked are drawn.
    table : pd.DataFrame
        As from `compare_registrations`.
    note : str
        What the data are, for the caption.
    """
    frames, methods = sorted(set(clicks["frame"])), list(table["method"])
    figure, axes = new_figure(1, len(frames) + 1, 4.2 * len(frames) + 4.0, 4.4)
    shown = clicks[["frame", "marker"]].merge(pixels, on=["frame", "marker"])
    for axis, frame in zip(axes, frames, strict=False):
        _draw_markers(axis, recording, frame, clicks[clicks["frame"] == frame], shown, methods)
    known = bool(table["added_m"].notna().any())
    column, label = _ADDED if known else _LEAVE_ONE_OUT
    _draw_bars(axes[-1], 1000 * table.set_index("method")[column], label)
    marks.legend_below(figure, axes[0])
    what = (
        "how far it puts the person's markers from where they truly are, median over markers, frames, people"
        if known
        else "the median error of a marker under the fit of the others"
    )
    said = series_text(1000 * table.set_index("method")[column].dropna(), "{} {:.0f} mm")
    return Figure(figure, *texts("registration", what=what, note=note, said=said), table)


def _draw_markers(axis, recording: Recording, frame: int, clicks, pixels: pd.DataFrame, methods) -> None:
    axis.imshow(read_rgb(recording, frame))
    circle = {"color": "white", "mfc": "none", "mew": 1.5, "markersize": 11, "path_effects": _OUTLINED}
    axis.plot(clicks["u_px"], clicks["v_px"], "o", label="clicked", **circle)
    for method, (colour, shape) in zip(methods, _STYLES, strict=False):
        part = pixels[(pixels["method"] == method) & (pixels["frame"] == frame)]
        axis.plot(part["u_px"], part["v_px"], shape, color=colour, mew=1.8, markersize=9, label=method)
    pixels_px, size = clicks[["u_px", "v_px"]], recording.intrinsics
    left, top = np.maximum(pixels_px.min() - _MARGIN_PX, 0)
    right, bottom = np.minimum(pixels_px.max() + _MARGIN_PX, (size.width_px, size.height_px))
    axis.set(xlim=(left, right), ylim=(bottom, top), xticks=[], yticks=[], title=f"frame {frame}")
    axis.grid(False)


def _draw_bars(axis, values_mm: pd.Series, label: str) -> None:
    colours = [colour for colour, _ in _STYLES[: len(values_mm)]]
    axis.barh(range(len(colours)), values_mm.iloc[: len(colours)], color=colours, height=0.55)
    marks.name_rows(axis, [name.replace(": ", ":\n") for name in values_mm.index])
    axis.set(xlabel=label)
    axis.grid(axis="y", visible=False)
