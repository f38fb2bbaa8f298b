"""What a text table is: motion capture, a trajectory, a list of images, joints, clicks, detections."""

from pathlib import Path

import numpy as np
import pandas as pd

from hicp_lib.core.errors import InputError, one_line
from hicp_lib.formats.annotations import read_detections
from hicp_lib.inspection.facts import Facts, about_people, about_scores, about_times
from hicp_lib.inspection.json_files import ORIGIN
from hicp_lib.recordings.importing import read_pose_source
from hicp_lib.recordings.qualisys import read_mocap
from hicp_lib.recordings.tum import read_file_list

_HEAD_LINES = 40
_CSV_KINDS = {  # columns that tell a kind -> the kind
    ("frame", "marker", "u_px", "v_px"): "clicks on markers, for the registration",
    ("t_s", "torso_pitch_deg"): "joint angles of the robot in degrees",
}


def inspect_text(path: Path, head: str) -> Facts:
    """Say what a text file is that is not JSON.

    Parameters
    ----------
    path : Path
    head : str
        How it begins.

    Returns
    -------
    Facts

    Raises
    ------
    InputError
        If it is of no kind that is known, or malformed.
    """
    lines = [line.strip() for line in head.splitlines()[:_HEAD_LINES] if line.strip()]
    if any(line.split("\t")[0].upper() == "NO_OF_MARKERS" for line in lines):
        return inspect_mocap(path, "Qualisys TSV")
    rows = [line.replace(",", " ").split() for line in lines if not line.startswith("#")]
    comment = next((line for line in lines if line.startswith("#")), "")
    if rows and len(rows[0]) == 2 and _are_numbers(rows[0][:1]) and not _are_numbers(rows[0][1:]):
        return _file_list(path)
    if rows and _are_numbers(rows[0]):
        return _trajectory(path, len(rows[0]), comment)
    if rows and "," in lines[0]:
        return _csv(path)
    raise InputError(f"{path}: text of no kind that is known; see the pages on recordings and importing")


def inspect_mocap(path: Path, kind: str) -> Facts:
    """Say what a file of motion capture holds.

    Parameters
    ----------
    path : Path
    kind : str
        What it is called.

    Returns
    -------
    Facts
    """
    mocap = read_mocap(path)
    seen = np.isfinite(mocap.points_m).all(axis=-1)
    extent_m = np.ptp(mocap.points_m[seen], axis=0) if seen.any() else np.full(3, np.nan)
    names = ", ".join(mocap.names[:12]) + (" ..." if len(mocap.names) > 12 else "")
    says = {
        "markers": f"{len(mocap.names)}: {names}",
        "frames": f"{len(mocap.times_s)}; markers seen in {100 * seen.mean():.1f} %",
        "units": "metres once read; extent {:.2f} x {:.2f} x {:.2f}".format(*extent_m),
        "times": about_times(mocap.times_s, f"the system's own clock, {mocap.rate_hz:g} Hz stated"),
    }
    needs = {"the 3D error against motion capture": "a recording, with this file in its folder"}
    return Facts(path, kind, says, needs=needs)


def inspect_detections_table(path: Path) -> Facts:
    """Say what a table of detections holds (CSV or Parquet).

    Parameters
    ----------
    path : Path

    Returns
    -------
    Facts
    """
    found = read_detections(path)
    points_px = np.concatenate([np.zeros((0, 136, 2)), *(of.keypoints_px for of in found.values())])
    scores = np.concatenate([np.zeros((0, 136)), *(of.scores for of in found.values())])
    says = {
        "people": f"{len(points_px)} in {len(found)} images",
        "scores": about_scores(scores[np.isfinite(points_px).all(axis=-1)]),
        **about_people(points_px, "keypoints"),
        "pixel origin": ORIGIN,
    }
    return Facts(path, "detections by hicp detect", says, needs={"hicp evaluate": "--annotations"})


def _are_numbers(words: list[str]) -> bool:
    try:
        return bool([float(word) for word in words])
    except ValueError:
        return False


def _file_list(path: Path) -> Facts:
    times_s, names = read_file_list(path)
    missing = sum(not (path.parent / name).is_file() for name in names)
    says = {
        "images": f"{len(names)}; {missing} of them are not there" if missing else str(len(names)),
        "times": about_times(times_s, "seconds, when each image was taken"),
    }
    return Facts(
        path, "list of images and their times (TUM)", says, needs={"hicp record check": "its folder"}
    )


def _trajectory(path: Path, n_columns: int, comment: str) -> Facts:
    times_s, T_base_cam = read_pose_source(path)
    moved_m = np.ptp(T_base_cam[:, :3, 3], axis=0)
    says = {
        "poses": f"{len(T_base_cam)}, camera to base; {n_columns} numbers in the first line",
        "units": "metres; moved " + "{:.3f} x {:.3f} x {:.3f}".format(*moved_m),
        "times": about_times(times_s, "seconds"),
    }
    notes = [f"its first comment: {comment}"] if comment else []
    return Facts(path, "trajectory of a camera", says, notes, {"hicp record import": "--bag or --open3d"})


def _csv(path: Path) -> Facts:
    try:
        table = pd.read_csv(path)
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: is not a CSV table ({one_line(error)})") from None
    if {"keypoint", "u_px", "v_px", "image_id"} <= set(table):
        return inspect_detections_table(path)
    for columns, kind in _CSV_KINDS.items():
        if set(columns) <= set(table):
            says = {"rows": str(len(table)), "columns": ", ".join(map(str, table))}
            if "t_s" in table:
                read_pose_source(path)
                says["times"] = about_times(table["t_s"].to_numpy(float), "seconds")
            return Facts(path, kind, says)
    return _trajectory(path, table.shape[1], "")
