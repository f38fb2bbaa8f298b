"""Figure of the layouts: which keypoints each convention gives, on the body model."""

import numpy as np
import pandas as pd

from hicp_lib.core.datafiles import DATA_DIR
from hicp_lib.core.files import read_json
from hicp_lib.core.keypoints import BODY, COCO_17, FACE, HANDS, LEFT_HAND, LIMBS, TO_HALPE
from hicp_lib.simulation.body.joints import pose_from_joints, radians
from hicp_lib.simulation.body.model import load_body, pose_body
from hicp_lib.study.plots.marks import legend_below
from hicp_lib.study.plots.style import Figure, in_style, new_figure, series_text

_PARTS = {
    "COCO's body": (COCO_17, "#0072B2", "o", 4.5),
    "more of the body, feet": (np.setdiff1d(BODY, COCO_17), "#D55E00", "s", 4),
    "face": (FACE, "#009E73", "x", 1.8),
    "hands": (HANDS, "#CC79A7", "^", 2.2),
}
_ARMS_DEG = {"shoulder_abduction": 25, "forearm_supination": 80, "index_spread": 12, "little_spread": -15}


@in_style
def layouts() -> Figure:
    """Layouts of keypoints, as in the paper's Fig. 2, and a hand enlarged; the person faces the reader."""
    pose = pose_from_joints(radians(_ARMS_DEG, "left_") | radians(_ARMS_DEG, "right_"))
    points_m = pose_body(load_body(), "man_38_07", pose).keypoints_m[:, 1:]
    figure, axes = new_figure(2, 3, 6.4, 7.2)
    rows, made_of = [], read_json(DATA_DIR / "survey.json")["layouts"]
    for axis, (name, conventions) in zip(axes.flat, made_of.items(), strict=False):
        given = np.concatenate([TO_HALPE[convention] for convention in conventions])
        rows.append((name.replace("\n", " "), len(given), int((given >= 0).sum())))
        _draw(axis, points_m, given, f"{name}, {len(given)}")
    _draw(axes.flat[-1], points_m, LEFT_HAND, "a left hand, the same\nof all that give it")
    legend_below(figure, axes.flat[3], ncols=2)
    table = pd.DataFrame(rows, columns=["layout", "points", "drawn"])
    caption = (
        "Layouts of keypoints, how many, and those of them that are among the 136 all are brought to here. "
        "OpenPose's pupils are not, nor are MediaPipe's mouth, corners of the eyes and knuckles of the body."
    )
    said = series_text(table.set_index("layout")["points"], "{} {}")
    return Figure(figure, caption, f"Five people with the points of a layout each: {said}.", table)


def _draw(axis, points_m: np.ndarray, given: np.ndarray, title: str) -> None:
    for limb in (limb for limb in LIMBS if np.isin(limb, given).all()):
        axis.plot(*points_m[list(limb)].T, color="#BBBBBB", lw=1, zorder=1)
    for part, (indices, colour, marker, size) in _PARTS.items():
        shown_m = points_m[np.intersect1d(indices, given)]
        axis.plot(*shown_m.T, marker, color=colour, markersize=size, label=part)
    axis.set_title(title, loc="center", fontsize=9)
    axis.set_aspect("equal")
    axis.axis("off")
