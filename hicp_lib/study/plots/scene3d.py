"""One interactive 3D scene: what a camera saw as a point cloud, the robot, its cameras, the skeletons.

All in the robot's base frame (x backward, y to its right, z up), metres. Kept light: every kind of thing is
one line or one cloud for Plotly, in single precision, so the page stays small.
"""

import itertools
from collections.abc import Mapping

import numpy as np
import pandas as pd
import plotly.graph_objects as go

from hicp_lib.core.camera import Camera, deproject, transform
from hicp_lib.evaluation.space.stability import POSITION
from hicp_lib.recordings.recording import Recording, read_depth_m, read_rgb
from hicp_lib.robot.shape import Shape
from hicp_lib.study.plots.palette import TRUTH_COLOUR, detector_colour
from hicp_lib.study.plots.relative3d import limb_lines
from hicp_lib.study.plots.style import in_words

VIEW_STYLES = (("#E377C2", "solid"), ("#17BECF", "dash"))  # of its cameras, and of its skeletons' lines
_FRUSTUM_DEPTH_M = 0.05
_EYE = {"x": 0.6, "y": 1.4, "z": 0.6}  # from in front of the robot, to its right
_PEN_UP = np.full((1, 3), np.nan)


def scene(
    recordings: Mapping[str, Recording],
    medians: pd.DataFrame,
    robot: Shape | None = None,
    truth: Mapping[str, pd.DataFrame] | None = None,
) -> go.Figure:
    """The scene; every entry of its legend can be switched off.

    Parameters
    ----------
    recordings : mapping of str to Recording
        By view; all camera poses are drawn, and what the first saw in its first frame.
    medians : pd.DataFrame
        As from `hicp_lib.evaluation.space.stability.median_positions`, one method; one skeleton per view and
        detector.
    robot : Shape, optional
        The robot in the base frame; None where the joints are not known.
    truth : mapping of str to pd.DataFrame, optional
        By view, columns `keypoint, x_m, y_m, z_m`, of which the first is drawn; None where not known.

    Returns
    -------
    plotly.graph_objects.Figure
    """
    first = next(iter(recordings))
    traces = [point_cloud(recordings[first], 0)]
    if robot is not None:
        traces.append(_solid(robot, "robot"))
    styles = dict(zip(recordings, itertools.cycle(VIEW_STYLES), strict=False))
    for view, recording in recordings.items():
        lines = _frusta(recording.intrinsics, recording.T_base_cam)
        traces.append(_line(lines, f"cameras ({view})", styles[view][0], 1))
    for (view, detector), rows in medians.groupby(["view", "detector"], sort=False):
        colour, (_, dash) = detector_colour(detector), styles[view]
        traces.append(_line(limb_lines(rows, POSITION), f"{detector} ({view})", colour, 6, dash))
    if truth is not None:
        traces.append(_line(limb_lines(truth[first], POSITION), "true skeleton", TRUTH_COLOUR, 3))
    figure = go.Figure(traces)
    axes = {f"{axis}axis": {"title": f"{axis} [m]", "backgroundcolor": "#FAFAFA"} for axis in "xyz"}
    figure.update_layout(
        scene={**axes, "aspectmode": "data", "camera": {"eye": _EYE}},
        margin={"l": 0, "r": 0, "t": 0, "b": 0}, height=640, template="plotly_white",
        # Below, where its long names leave the scene the width of a phone.
        legend={"itemsizing": "constant", "orientation": "h", "y": 0, "yanchor": "top"},
    )  # fmt: skip
    return figure


def point_cloud(
    recording: Recording, frame: int, n_points: int = 15_000, max_depth_m: float = 1.7
) -> go.Scatter3d:
    """What the camera saw in one frame, as coloured points in the base frame.

    Parameters
    ----------
    recording : Recording
    frame : int
    n_points : int
        About so many.
    max_depth_m : float
        What is farther is left out.

    Returns
    -------
    plotly.graph_objects.Scatter3d
    """
    depth_m, rgb = read_depth_m(recording, frame), read_rgb(recording, frame)
    n_near = int((depth_m < max_depth_m).sum())  # no depth is NaN: not near
    step = max(1, int(np.ceil(np.sqrt(n_near / n_points))))
    v, u = np.mgrid[0 : depth_m.shape[0] : step, 0 : depth_m.shape[1] : step]
    depth_m, colours = depth_m[v, u], rgb[v, u]
    near = depth_m < max_depth_m
    pixels_px = np.stack([u[near], v[near]], axis=-1)
    in_camera = deproject(recording.intrinsics, pixels_px, depth_m[near])
    x, y, z = transform(recording.T_base_cam[frame], in_camera).astype(np.float32).T
    marker = {"size": 2, "color": [f"#{bytes(colour).hex()}" for colour in colours[near]]}
    return go.Scatter3d(x=x, y=y, z=z, mode="markers", marker=marker, name="point cloud", hoverinfo="skip")


def _solid(shape: Shape, name: str) -> go.Mesh3d:
    (x, y, z), (i, j, k) = shape.vertices_m.T, shape.triangles.astype(np.uint16).T
    colours = np.round(255 * shape.colours ** (1 / 2.2)).astype(np.uint8)
    painted = [f"#{bytes(colour).hex()}" for colour in colours]
    said = {"name": name, "hoverinfo": "name", "showlegend": True}
    return go.Mesh3d(x=x, y=y, z=z, i=i, j=j, k=k, vertexcolor=painted, **said)


def _line(points_m: np.ndarray, name: str, colour: str, width: float, dash: str = "solid") -> go.Scatter3d:
    """A line through points (n, 3), interrupted where they are NaN."""
    x, y, z = points_m.astype(np.float32).T
    line = {"color": colour, "width": width, "dash": dash}
    said = {"name": name, "hoverinfo": "name"}
    return go.Scatter3d(x=x, y=y, z=z, mode="lines", line=line, connectgaps=False, **said)


def _frusta(intrinsics: Camera, T_base_cam: np.ndarray) -> np.ndarray:
    """Lines of a small pyramid per camera pose, shape (n, 3)."""
    right, bottom = intrinsics.width_px - 0.5, intrinsics.height_px - 0.5
    pixels_px = np.array([(-0.5, -0.5), (right, -0.5), (right, bottom), (-0.5, bottom)])
    a, b, c, d = deproject(intrinsics, pixels_px, np.full(4, _FRUSTUM_DEPTH_M))
    apex = np.zeros(3)
    lines = np.array([a, b, c, d, a, apex, b, c, apex, d, *_PEN_UP])
    return transform(T_base_cam, lines).reshape(-1, 3)


def describe(figure: go.Figure) -> str:
    """What the scene holds, for readers who cannot see it."""
    names = in_words([trace.name for trace in figure.data])
    return f"Interactive 3D scene in the robot's base frame with: {names}."
