"""Markers clicked in images: `clicks.csv` of a recording, and a figure to read positions from.

    frame,marker,u_px,v_px
    12,elbow_left_1,311.5,207

`show_frame` shows an image that can be zoomed in the browser and displays the pixel under the pointer;
`record_click` saves positions read this way. This needs no extension of Jupyter and also works in exported
pages.
"""

import base64
from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np
import pandas as pd

from hicp_lib.core.errors import InputError
from hicp_lib.core.extras import needs
from hicp_lib.core.files import write_bytes
from hicp_lib.core.images import inside
from hicp_lib.formats.json_validation import is_number
from hicp_lib.recordings.recording import Recording, read_csv, read_rgb

with needs("report"):
    import plotly.graph_objects as go

CLICKS_FILE = "clicks.csv"
COLUMNS = ["frame", "marker", "u_px", "v_px"]
_MARGINS_PX = 160  # of the figure, around the image


def read_clicks(path: str | Path, recording: Recording, markers: Sequence[str]) -> pd.DataFrame:
    """Read and check a clicks file.

    Parameters
    ----------
    path : str or Path
    recording : Recording
        The recording with the clicked images.
    markers : sequence of str
        Names in the motion capture.

    Returns
    -------
    pd.DataFrame
        Columns `frame` (row of the recording), `marker`, `u_px, v_px`.

    Raises
    ------
    InputError
        If it is not such a table; the row is named.
    """
    table = read_csv(path, ["frame", "u_px", "v_px"], ["marker"])[COLUMNS]
    if table.empty:
        raise InputError(f"{path}: has no rows; expected one per click")
    for row, click in enumerate(table.to_dict("records"), start=2):
        _check_click(f"{path}: row {row}", click, recording, markers)
    twice = table.duplicated(["frame", "marker"])
    if twice.any():
        again = f"{table['marker'][twice].iloc[0]} is clicked twice in this frame"
        raise InputError(f"{path}: row {twice.idxmax() + 2}: {again}; keep one of them")
    return table.astype({"frame": int, "u_px": float, "v_px": float})


def record_click(
    recording: Recording, markers: Sequence[str], frame: int, marker: str, u_px: float, v_px: float
) -> pd.DataFrame:
    """Save a marker's position in the recording's `clicks.csv`, replacing an earlier one.

    Parameters
    ----------
    recording : Recording
    markers : sequence of str
        Names in the motion capture.
    frame : int
        Row of the recording.
    marker : str
    u_px, v_px : float
        Pixel centres at integers.

    Returns
    -------
    pd.DataFrame
        All clicks so far, as `read_clicks`.

    Raises
    ------
    InputError
        If there is no such frame, marker or pixel, or the existing file is malformed.
    """
    path = recording.folder / CLICKS_FILE
    click = {"frame": frame, "marker": marker, "u_px": u_px, "v_px": v_px}
    _check_click("click", click, recording, markers)
    clicks = pd.DataFrame([click], columns=COLUMNS)
    if path.is_file():
        before = read_clicks(path, recording, markers)
        same = (before["frame"] == frame) & (before["marker"] == marker)
        clicks = pd.concat([before[~same], clicks], ignore_index=True)
    write_bytes(path, clicks.to_csv(index=False).encode())
    return clicks


def show_frame(recording: Recording, frame: int, clicks: pd.DataFrame | None = None) -> go.Figure:
    """The image of a frame, to zoom into (drag) and read pixels from (hover); clicks so far are marked.

    Parameters
    ----------
    recording : Recording
    frame : int
        Row of the recording.
    clicks : pd.DataFrame, optional
        As from `read_clicks`.

    Returns
    -------
    plotly.graph_objects.Figure
    """
    _, encoded = cv2.imencode(".png", cv2.cvtColor(read_rgb(recording, frame), cv2.COLOR_RGB2BGR))
    source = f"data:image/png;base64,{base64.b64encode(encoded.tobytes()).decode()}"
    figure = go.Figure(go.Image(source=source, hovertemplate="u %{x}, v %{y}<extra></extra>"))
    if clicks is not None:
        here = clicks[clicks["frame"] == frame]
        marks = {"symbol": "cross-thin", "size": 14, "line": {"width": 2, "color": "#D55E00"}}
        figure.add_scatter(
            x=here["u_px"], y=here["v_px"], text=here["marker"], mode="markers+text", marker=marks,
            textposition="top center", textfont={"color": "#D55E00"}, hoverinfo="text", showlegend=False,
        )  # fmt: skip
    title = f"frame {frame}: drag to zoom, double-click to go back"
    width = recording.intrinsics.width_px + _MARGINS_PX
    return figure.update_layout(title=title, dragmode="zoom", width=width, margin={"t": 40, "b": 20})


def _check_click(where: str, click: dict, recording: Recording, markers: Sequence[str]) -> None:
    frame, marker, *pixel = (click[name] for name in COLUMNS)
    if not is_number(frame) or frame != int(frame) or not 0 <= frame < len(recording):
        expected = f"expected a whole number from 0 to {len(recording) - 1}"
        raise InputError(f"{where}: frame is {frame!r}; {expected}")
    if marker not in markers:
        known = ", ".join(markers)
        raise InputError(f"{where}: marker {str(marker)[:80]!r} is not in the motion capture; it has {known}")
    sizes = (recording.intrinsics.width_px, recording.intrinsics.height_px)
    for name, value, size in zip(COLUMNS[2:], pixel, sizes, strict=True):
        if not is_number(value) or not inside(np.array([value, 0]), (0, 0, size, 1)):
            raise InputError(f"{where}: {name} is {value!r}; expected a pixel from 0 to {size - 1}")
