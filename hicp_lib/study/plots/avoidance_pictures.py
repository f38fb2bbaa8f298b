"""Pictures of a run: what the camera sees beside robot and person in space, as a strip and as an animation.

Robot and person are drawn in parallel projection; a taxel is the darker red the more it is threatened.
"""

import io
from collections.abc import Sequence

import matplotlib as mpl
import numpy as np
import pandas as pd
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection
from PIL import Image

from hicp_lib.core.keypoints import LIMBS
from hicp_lib.experiments.avoidance.closed_loop import start_posture
from hicp_lib.experiments.avoidance.reaching import LEAVES_S, NEAR_S, script
from hicp_lib.experiments.avoidance.runs import Run, image
from hicp_lib.experiments.laboratory import in_root
from hicp_lib.robot.kinematics import ARM_JOINTS, load_icub
from hicp_lib.robot.posture import Posture
from hicp_lib.robot.segments import body_segments
from hicp_lib.robot.skin import read_skin
from hicp_lib.study.avoidance import SURE, sure_keypoints
from hicp_lib.study.plots.avoidance import condition_colour
from hicp_lib.study.plots.people import draw_people, picture_grid
from hicp_lib.study.plots.style import Figure, in_style, in_words, new_figure

_TURN_RAD, _TILT_RAD = np.radians(35.0), np.radians(18.0)  # of the view: to the side, from above
_LIMITS_M = ((-1.2, 0.3), (-0.48, 0.7))
_PERSON_COLOUR = "#666666"
_LOWERED_M = 0.1  # the picture's origin lies above the root
_WEBP = {"quality": 55, "method": 4}


@in_style
def filmstrip(run: Run, times_s: Sequence[float], note: str) -> Figure:
    """Some moments of a run, one column each: the camera's picture, and robot and person in space.

    Parameters
    ----------
    run : Run
    times_s : sequence of float
        Of the moments.
    note : str
        What the data are, for the caption.
    """
    figure, axes = new_figure(2, len(times_s), 3.0 * len(times_s), 4.9, squeeze=False)
    for (above, below), time_s in zip(axes.T, times_s, strict=True):
        _draw_moment(above, below, run, time_s)
    nearest = 100 * run.cycles["distance_m"].min()
    return Figure(
        figure,
        f"{run.job.trial.script}, {run.job.condition}: the image the robot last took with what was found in "
        f"it, and robot and person in space, threatened taxels red. Data: {note}.",
        f"{len(times_s)} moments: the person comes near and the robot's arm gives way; never nearer than "
        f"{nearest:.1f} cm.",
    )


def nearest_views(runs: Sequence[Run], note: str) -> Figure:
    """The image each detector last took half-way through the time the person is near: a row per script.

    Parameters
    ----------
    runs : sequence of Run
        Those without images are left out.
    note : str
        What the data are, for the caption.
    """
    shown: dict[str, dict[str, np.ndarray]] = {}
    for run in runs:
        past = run.frames[run.frames["t_s"] <= (NEAR_S + LEAVES_S[0]) / 2] if len(run.frames) else run.frames
        if len(past):
            shown.setdefault(run.job.trial.script, {})[run.job.condition] = _drawn(run, past.iloc[-1])
    detectors = list(dict.fromkeys(name for pictures in shown.values() for name in pictures))
    return picture_grid(
        [[pictures.get(name) for name in detectors] for pictures in shown.values()],
        row_titles=list(shown),
        titles=detectors,
        caption="Through the robot's eyes when the person is near: the last image each detector had taken by "
        f"then, with keypoints of a score of at least {SURE}. Data: {note}.",
        alt=f"Pictures from above of {in_words(shown)}, with what {in_words(detectors)} found.",
        cell_in=min(3.2, 11 / max(len(detectors), 1)),
    )


def animation(run: Run, rate_hz: float = 6.0, dpi: int = 64) -> bytes:
    """The same as an animated WebP in real time.

    Parameters
    ----------
    run : Run
    rate_hz : float
        Pictures per second.
    dpi : int

    Returns
    -------
    bytes
        The file's content.
    """
    pictures, times_s = [], np.arange(0, run.cycles["t_s"].iloc[-1], 1 / rate_hz).tolist()
    with mpl.rc_context({"figure.constrained_layout.use": True, "font.size": 10}):
        figure, (camera, space) = new_figure(1, 2, 10.4, 4.0, width_ratios=[1.15, 1])
        canvas = FigureCanvasAgg(figure)
        figure.set_dpi(dpi)
        _draw_moment(camera, space, run, times_s[0])
        canvas.draw()
        figure.set_layout_engine("none")  # all pictures are laid out like the first
        for time_s in times_s:
            for drawn in [artist for axis in (camera, space) for artist in (*axis.images, *axis.collections)]:
                drawn.remove()
            _draw_moment(camera, space, run, time_s)
            canvas.draw()
            pictures.append(Image.fromarray(np.asarray(canvas.buffer_rgba())[..., :3]))
    content, period_ms = io.BytesIO(), round(1000 / rate_hz)
    sequence = {"save_all": True, "append_images": pictures[1:], "duration": period_ms, "loop": 0}
    pictures[0].save(content, "webp", **sequence, **_WEBP)
    return content.getvalue()


def _draw_moment(camera, space, run: Run, time_s: float) -> None:
    cycle = run.cycles.iloc[int(np.argmin(np.abs(run.cycles["t_s"] - time_s)))]
    past = run.frames[run.frames["t_s"] <= time_s + 1e-9]
    frame = past.iloc[-1] if len(past) else None
    _draw_image(camera, run, frame, time_s)
    _draw_space(space, run, cycle, frame)
    space.set_title(f"{100 * cycle['distance_m']:.0f} cm, activation {cycle['activation']:.2f}")


def _draw_image(axis, run: Run, frame: pd.Series | None, time_s: float) -> None:
    axis.axis("off")
    axis.set_title(f"{time_s:.1f} s")
    if frame is not None:
        axis.imshow(_drawn(run, frame))


def _drawn(run: Run, frame: pd.Series) -> np.ndarray:
    rgb, found = image(frame)
    return draw_people(rgb, found.keypoints_px, found.scores, condition_colour(run.job.condition), SURE, 2.0)


def _draw_space(axis, run: Run, cycle: pd.Series, frame: pd.Series | None) -> None:
    trial = run.job.trial
    truth_m = in_root(script(trial.script, trial.subject).person_at(cycle["t_s"]).keypoints_m)
    posture = start_posture().moved("left", np.array([cycle[f"{joint}_rad"] for joint in ARM_JOINTS]))
    _draw_robot(axis, posture)
    limbs = np.stack(_project(truth_m[np.array(LIMBS)]), axis=-1)
    axis.add_collection(LineCollection(list(limbs), linewidths=1.2, colors=_PERSON_COLOUR, zorder=2))
    positions, _ = read_skin().in_root(load_icub(), posture)
    u, v = _project(positions)
    axis.scatter(u, v, c=np.asarray(cycle["activations"]), s=9, cmap="Reds", vmin=0, vmax=0.5, lw=0, zorder=3)
    if frame is not None:
        points_m, is_sure, _ = sure_keypoints(frame)
        u, v = _project(points_m[is_sure])
        axis.scatter(u, v, s=8, color=condition_colour(run.job.condition), zorder=4)
    axis.set(xlim=_LIMITS_M[0], ylim=_LIMITS_M[1], aspect="equal")
    axis.axis("off")


def _draw_robot(axis, posture: Posture) -> None:
    points_per_m = 72 * axis.get_position().width * axis.figure.get_figwidth() / np.ptp(_LIMITS_M[0])
    segments = body_segments(load_icub(), posture)
    ends = np.stack(_project(np.stack([(s.start_m, s.end_m) for s in segments])), axis=-1)
    widths = [2 * segment.radius_m * points_per_m for segment in segments]
    bars = LineCollection(list(ends), linewidths=widths, colors="#C9CED6", capstyle="round", zorder=0)
    axis.add_collection(bars)


def _project(points_m: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Points (..., 3) of the root frame as they lie in the picture: to the right, and up."""
    x, y, z = np.moveaxis(np.asarray(points_m, float), -1, 0)
    right = np.cos(_TURN_RAD) * x - np.sin(_TURN_RAD) * y
    away = np.sin(_TURN_RAD) * x + np.cos(_TURN_RAD) * y
    return right, np.cos(_TILT_RAD) * z - np.sin(_TILT_RAD) * away - _LOWERED_M
