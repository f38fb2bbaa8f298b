"""Figures of the relative 3D test: what the robot saw, median skeletons, stability, accuracy."""

import itertools
from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd
from matplotlib.ticker import LogLocator, NullLocator

from hicp_lib.core.detections import Detections
from hicp_lib.core.keypoints import HANDS, INDEX, LIMBS, N_KEYPOINTS
from hicp_lib.inspection.skeletons import draw_rings
from hicp_lib.recordings.recording import Recording, read_rgb
from hicp_lib.study.plots import marks
from hicp_lib.study.plots.palette import TRUTH_COLOUR, detector_colour, detector_marker
from hicp_lib.study.plots.people import detections_grid
from hicp_lib.study.plots.style import COLUMN_IN, Figure, in_style, new_figure, series_text, texts
from hicp_lib.study.table_format import intervals_over

_AXES = ("x_m", "y_m", "z_m")
# Seen by the robot, which looks along -x; the axis that is not drawn is the one looked along.
_DIRECTIONS = {
    "as the robot looks": ("y_m", "z_m"), "from its left": ("x_m", "z_m"), "from above": ("y_m", "x_m"),
}  # fmt: skip
# Fewer images than this say little about a spread.
MIN_IMAGES = 5
_SPREAD, _BIAS = "spread: from the median [cm]", "bias: median to truth [cm]"


def camera_views(
    recordings: Mapping[str, Recording],
    found: Mapping[tuple[str, str], Sequence[Detections]],
    frames: Sequence[int],
    min_score: float,
    note: str,
    markers: pd.DataFrame | None = None,
) -> Figure:
    """Some frames of every view, as each detector sees them.

    Parameters
    ----------
    recordings : mapping of str to Recording
        By view.
    found : mapping of (str, str) to sequence of Detections
        By view and detector, one of each frame.
    frames : sequence of int
        Numbers of frames that every view has.
    min_score : float
        Keypoints below it are not drawn.
    note : str
        What the data are, for the caption.
    markers : pd.DataFrame, optional
        What is ringed, columns `frame, u_px, v_px`, as from
        `hicp_lib.evaluation.space.registration_error.marker_pixels`.
    """
    pictures = {}
    for k, (view, recording) in itertools.product(frames, recordings.items()):
        ringed_px = [] if markers is None else markers.loc[markers["frame"] == k, ["u_px", "v_px"]]
        image = draw_rings(read_rgb(recording, k), np.reshape(ringed_px, (-1, 2)), 7)
        people = {detector: of[k] for (seen_from, detector), of in found.items() if seen_from == view}
        pictures[f"{view}, image {k}"] = image, people
    return detections_grid(pictures, min_score, f"Data: {note}.")


@in_style
def median_skeletons(medians: pd.DataFrame, truth: Mapping[str, pd.DataFrame] | None, note: str) -> Figure:
    """Median skeletons of every detector in the base frame, seen along its axes; dashed: the true one.

    Parameters
    ----------
    medians : pd.DataFrame
        As from `hicp_lib.evaluation.space.stability.median_positions`, one method.
    truth : mapping of str to pd.DataFrame or None
        By view, columns `keypoint, x_m, y_m, z_m`; None where it is not known.
    note : str
        What the data are, for the caption.
    """
    fewest = min(MIN_IMAGES, medians["n"].max())
    medians = medians[medians["n"] >= fewest]
    views = medians["view"].unique()
    limits = {name: (medians[name].min() - 0.05, medians[name].max() + 0.05) for name in _AXES}
    widths = [float(np.ptp(limits[across])) for across, _ in _DIRECTIONS.values()]
    shape = {"width_ratios": widths, "squeeze": False}
    figure, axes = new_figure(len(views), 3, COLUMN_IN, 3.1 * len(views) + 0.5, **shape)
    for row, view in zip(axes, views, strict=True):
        skeletons = dict(list(medians[medians["view"] == view].groupby("detector", sort=False)))
        lines = [(name, rows, detector_colour(name), "-") for name, rows in skeletons.items()]
        if truth is not None:
            lines.insert(0, ("truth", truth[view], TRUTH_COLOUR, "--"))
        for axis, (direction, columns) in zip(row, _DIRECTIONS.items(), strict=True):
            for name, rows, colour, style in lines:
                _draw_skeleton(axis, rows, columns, colour, style, name)
            across, up = columns
            axis.set(aspect="equal", xlim=limits[across], ylim=limits[up])
            axis.set(title=direction, xlabel=f"{across[0]} [m]", ylabel=f"{view}, {up[0]} [m]")
            axis.yaxis.set_inverted(up == "x_m")  # forward is up
    marks.legend_below(figure, axes)
    counts = medians.groupby(["detector", "view"], sort=False).size()
    told = {"fewest": fewest, "dashed": "; dashed: the true skeleton" * bool(truth), "note": note, "off": ""}
    if truth:
        true = pd.concat([rows.drop_duplicates("keypoint").assign(view=view) for view, rows in truth.items()])
        both = medians.merge(true, on=["view", "keypoint"], suffixes=("", "_true"))
        off_m = np.linalg.norm(both[[*_AXES]] - both[[f"{name}_true" for name in _AXES]].to_numpy(), axis=1)
        off_cm = (100 * pd.Series(off_m)).groupby(both["detector"], sort=False).median()
        told["off"] = f" Median distance from the truth: {series_text(off_cm, '{} {:.1f} cm')}."
    return Figure(figure, *texts("median_skeletons", **told, said=counts), medians)


def _draw_skeleton(axis, rows: pd.DataFrame, columns: tuple[str, str], colour, style, label) -> None:
    pen = {"color": colour, "linestyle": style, "alpha": 0.9}
    marker = None if style == "--" else detector_marker(label)
    axis.plot(*limb_lines(rows, columns, BODY_LIMBS).T, lw=1.4, marker=marker, ms=4, label=label, **pen)
    axis.plot(*limb_lines(rows, columns, HAND_LIMBS).T, lw=0.7, **pen)


@in_style
def spread_against_bias(table: pd.DataFrame, method: str, note: str) -> Figure:
    """How far apart the views are against how far off their median is: a panel per joint, a mark per side.

    Parameters
    ----------
    table : pd.DataFrame
        As from `hicp_lib.evaluation.space.sightings.spread_and_bias`, with truth.
    method : str
        The lifting that is drawn.
    note : str
        What the data are, for the caption.
    """
    rows = table[table["method"] == method]
    rows = rows[(rows["n_images"] >= min(MIN_IMAGES, rows["n_images"].max())) & rows["spread_m"].notna()]
    rows = rows.assign(joint=rows["part"].str.split().str[1] + "s")
    views = list(rows["view"].unique())
    size = COLUMN_IN, 1.2 + 2.6 * np.ceil(rows["joint"].nunique() / 2)
    figure, axes, panels = marks.panels(rows, ["joint"], *size, wrap=2, sharex=True, sharey=True)
    for axis, of_joint, joint in panels:
        for (detector, view), dots in of_joint.groupby(["detector", "view"], sort=False):
            names = ((name, f"{name}_low", f"{name}_high") for name in ("spread_m", "bias_m"))
            xerr, yerr = (100 * marks.whiskers(dots, *bounds) for bounds in names)
            pen = marks.detector_dots([detector])[detector] | {"label": f"{detector}, {view}"}
            pen |= {"mfc": "white"} if views.index(view) else {}
            pen |= {"xerr": xerr, "yerr": yerr, "ms": 6.5, "elinewidth": 0.7}
            axis.errorbar(100 * dots["spread_m"], 100 * dots["bias_m"], **pen)
        axis.set(xscale="log", yscale="log", title=joint, xlabel=_SPREAD, ylabel=_BIAS)
        for scale in (axis.xaxis, axis.yaxis):  # plain numbers
            scale.set_major_locator(LogLocator(subs=(1, 2, 5)))
            scale.set_major_formatter("{x:g}")
            scale.set_minor_locator(NullLocator())
        axis.axline((1, 1), (2, 2), color="#888888", lw=1, ls="--")
        axis.label_outer()
    marks.legend_below(figure, axes)
    n_bias, n = (rows["bias_m"] > rows["spread_m"]).sum(), len(rows)
    told = {"method": method, "filled": views[0], "intervals": intervals_over(rows), "note": note}
    biases_cm = 100 * rows.groupby("detector", sort=False)["bias_m"].median()
    told |= {"n_bias": n_bias, "n": n, "biases": biases_cm}
    return Figure(figure, *texts("spread_against_bias", **told), table)


BODY_LIMBS = [limb for limb in LIMBS if limb[0] not in HANDS]
HAND_LIMBS = [limb for limb in LIMBS if limb[0] in HANDS]


def limb_lines(
    rows: pd.DataFrame, columns: Sequence[str], limbs: Sequence[tuple[int, int]] = LIMBS
) -> np.ndarray:
    """Limbs whose both ends are known, as one line that is interrupted by NaN.

    Parameters
    ----------
    rows : pd.DataFrame
        With `keypoint` (Halpe names) and coordinates; of a table with many frames, the first counts.
    columns : sequence of str
        The d coordinates.
    limbs : sequence of (int, int)
        Keypoints of Halpe-136 that are joined.

    Returns
    -------
    array, shape (3 n, d)
        Start, end and NaN of every limb.

    Examples
    --------
    >>> elbow_and_wrist = pd.DataFrame({"keypoint": ["left_elbow", "left_wrist"], "x_m": [0.0, 0.3]})
    >>> limb_lines(elbow_and_wrist, ["x_m"]).ravel().tolist()
    [0.0, 0.3, nan]
    """
    points = np.full((N_KEYPOINTS, len(columns)), np.nan)
    rows = rows.drop_duplicates("keypoint")
    points[rows["keypoint"].map(INDEX)] = rows[list(columns)]
    ends = points[np.array(limbs)]
    ends = ends[np.isfinite(ends).all(axis=(1, 2))]
    return np.concatenate([ends, np.full_like(ends[:, :1], np.nan)], axis=1).reshape(-1, len(columns))
