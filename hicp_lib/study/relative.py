"""The data of the relative 3D test: recordings of a still person, detected and lifted, view by view.

A *view* is one recording: "upper" and "lower" when simulated, as the paper's two holders of the camera; a
lab's own are called after their folders.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path

import pandas as pd

from hicp_lib.core.detections import Detections
from hicp_lib.core.errors import InputError
from hicp_lib.experiments.recordings.open import open_experiment
from hicp_lib.lifting.table import lift_found
from hicp_lib.recordings.recording import Recording, read_joints, read_truth
from hicp_lib.robot.kinematics import HEAD_JOINTS, load_icub
from hicp_lib.robot.posture import Posture
from hicp_lib.robot.shape import Shape, robot_shape
from hicp_lib.simulation.body.identities import Subject
from hicp_lib.study.mocap import detect_frames

Found = Mapping[tuple[str, str], Sequence[Detections]]


def open_views(
    recording: str = "", recording_lower: str = "", n_frames: int = 100, seed: int = 0
) -> dict[str, Recording]:
    """The recordings given by their views, or two simulated ones where none is.

    Parameters
    ----------
    recording, recording_lower : str
        Folders of a lab's own recordings of a person who sits still; the second is optional.
    n_frames, seed : int
        Of the simulated ones.

    Returns
    -------
    dict of str to Recording

    Raises
    ------
    InputError
        If a folder is not a recording.
    """
    given = [folder for folder in (recording, recording_lower) if folder]
    if not given:
        who = Subject(seed)
        return {view: open_experiment(f"relative-{view}", "", n_frames, who) for view in ("upper", "lower")}
    names = [Path(folder).name for folder in given]
    views = names if len(set(names)) == len(names) else given
    folders = zip(views, given, strict=True)
    return {view: open_experiment("relative-upper", folder) for view, folder in folders}


def detect_views(
    views: Mapping[str, Recording], detectors: Sequence[str]
) -> dict[tuple[str, str], list[Detections]]:
    """What detectors find in every frame of every view; kept on disk.

    Parameters
    ----------
    views : mapping of str to Recording
    detectors : sequence of str

    Returns
    -------
    dict of (str, str) to list of Detections
        By view and detector, in the order of the frames.
    """
    return {
        (view, detector): detections
        for view, recording in views.items()
        for detector, detections in detect_frames(recording, detectors).items()
    }


def lift_views(views: Mapping[str, Recording], found: Found) -> pd.DataFrame:
    """Everything lifted by every method.

    Parameters
    ----------
    views : mapping of str to Recording
    found : mapping of (str, str) to sequence of Detections
        As from `detect_views`.

    Returns
    -------
    pd.DataFrame
        Columns `view` and those of `hicp_lib.lifting.table.lift_found`.

    Raises
    ------
    InputError
        If no keypoint was found and lifted in any view, or a depth image cannot be read.
    """
    tables = []
    for view, recording in views.items():
        of_view = {detector: frames for (seen_from, detector), frames in found.items() if seen_from == view}
        table = lift_found(recording, of_view)
        tables.append(table.assign(view=view)[["view", *table.columns]])
    points = pd.concat(tables, ignore_index=True)
    if points["x_m"].isna().all():
        folders = ", ".join(str(recording.folder) for recording in views.values())
        raise InputError(
            f"{folders}: nobody was found and lifted in any image; record people in view, with depth"
        )
    return points


def true_positions(views: Mapping[str, Recording]) -> dict[str, pd.DataFrame] | None:
    """View -> table of `read_truth`; None when a view has none."""
    truth = {view: read_truth(recording) for view, recording in views.items()}
    return None if any(table is None for table in truth.values()) else truth


def robot_body(views: Mapping[str, Recording]) -> Shape | None:
    """The robot in the first view's first frame (base frame); None where joints are not known."""
    recording = next(iter(views.values()))
    joints, columns = read_joints(recording), [f"{name}_rad" for name in HEAD_JOINTS]
    if joints is None or not set(columns) <= set(joints):
        return None
    head_rad = joints.set_index("frame").loc[0, columns].to_numpy(float)
    return robot_shape(load_icub(), Posture(head_rad[:3], head_rad[3:]), "level")
