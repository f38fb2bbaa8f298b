"""The data of the relative 3D test: recordings of people who sit still, detected and lifted, view by view.

A *view* is one recording of each person: "upper" and "lower" when simulated, as the paper's two holders of
the camera; a lab's own are named after the folder of the first person. Frame numbers of a view continue from
person to person.
"""

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd

from hicp_lib.core.detections import Detections
from hicp_lib.core.errors import InputError
from hicp_lib.evaluation.cases import labelled, over_people
from hicp_lib.evaluation.space.stability import PARTS, PIXEL, Parts
from hicp_lib.experiments.recordings.open import open_people
from hicp_lib.lifting.table import lift_found
from hicp_lib.recordings.recording import Recording, read_joints, read_truth
from hicp_lib.robot.kinematics import HEAD_JOINTS, load_icub
from hicp_lib.robot.posture import Posture
from hicp_lib.robot.shape import Shape, robot_shape
from hicp_lib.study.mocap import detect_frames

Views = Mapping[str, Sequence[Recording]]
Found = Mapping[tuple[str, str], Sequence[Sequence[Detections]]]
Folders = str | Sequence[str]


def open_views(
    recording: Folders = "",
    recording_lower: Folders = "",
    n_frames: int = 8,
    n_people: int = 12,
    seed: int = 0,
) -> dict[str, list[Recording]]:
    """The given recordings by view, or two simulated ones of each person if none is given.

    Parameters
    ----------
    recording, recording_lower : str or sequence of str
        Folders of a lab's own recordings of people who sit still, one of each person; the second is optional.
    n_frames, n_people, seed : int
        Of the simulated ones: frames of each person and view, and how many people.

    Returns
    -------
    dict of str to list of Recording

    Raises
    ------
    InputError
        If a folder is not a recording, or the two views are of different numbers of people.
    """
    given = [open_people("relative-upper", folders) for folders in (recording, recording_lower) if folders]
    if not given:
        scenarios = {view: f"relative-{view}" for view in ("upper", "lower")}
        return {view: open_people(name, "", n_frames, n_people, seed) for view, name in scenarios.items()}
    counts = [len(people) for people in given]
    if len(set(counts)) > 1:
        said = f"{counts[0]} and {counts[1]} folders; give both views of the same people, in the same order"
        raise InputError(f"recording and recording_lower: {said}")
    names = [people[0].folder.name for people in given]
    views = names if len(set(names)) == len(names) else [str(people[0].folder) for people in given]
    return dict(zip(views, given, strict=True))


def subjects_of(views: Views) -> dict[str, np.ndarray]:
    """The subject of each image of a view, shape (n_frames,)."""
    return {view: np.repeat(np.arange(len(people)), [*map(len, people)]) for view, people in views.items()}


def of_person(views: Views, found: Found, number: int) -> tuple[dict[str, Recording], dict]:
    """One person's recordings by view, and the detections in them by view and detector.

    Parameters
    ----------
    views : mapping of str to sequence of Recording
    found : mapping of (str, str) to sequence
        By view and detector, of everybody.
    number : int
        Of the person, from 0 on.

    Returns
    -------
    seen : dict of str to Recording
    found : dict of (str, str) to list of Detections

    Raises
    ------
    InputError
        If there is no such person.
    """
    n_people = min(map(len, views.values()))
    if not 0 <= number < n_people:
        raise InputError(f"no person {number}; there are {n_people}, from 0 on")
    seen = {view: people[number] for view, people in views.items()}
    return seen, {case: of_people[number] for case, of_people in found.items()}


def detect_views(views: Views, detectors: Sequence[str]) -> dict[tuple[str, str], list[list[Detections]]]:
    """Detections in every frame of every person in every view; cached on disk.

    Parameters
    ----------
    views : mapping of str to sequence of Recording
    detectors : sequence of str

    Returns
    -------
    dict of (str, str) to list of list of Detections
        By view and detector: of each person, in the order of the frames.
    """
    found = {view: [detect_frames(one, detectors) for one in people] for view, people in views.items()}
    return {(view, name): [of[name] for of in found[view]] for view in views for name in detectors}


def lift_views(views: Views, found: Found) -> pd.DataFrame:
    """Lift all detections by every method.

    Parameters
    ----------
    views : mapping of str to sequence of Recording
    found : mapping of (str, str) to sequence of sequence of Detections
        As from `detect_views`.

    Returns
    -------
    pd.DataFrame
        Columns `view, subject` and those of `hicp_lib.lifting.table.lift_found`.

    Raises
    ------
    InputError
        If no keypoint was found and lifted in any view, or a depth image cannot be read.
    """
    tables = []
    for view, people in views.items():
        there = {name: of_people for (seen, name), of_people in found.items() if seen == view}
        theirs = ({name: of[k] for name, of in there.items()} for k in range(len(people)))
        lifted = list(map(lift_found, people, theirs))
        tables.append(labelled(over_people(lifted, [*map(len, people)]), view=view))
    points = pd.concat(tables, ignore_index=True)
    if points["x_m"].isna().all():
        folders = ", ".join(str(one.folder) for people in views.values() for one in people)
        said = "nobody was found and lifted in any image; record people in view, with depth"
        raise InputError(f"{folders}: {said}")
    return points


def true_positions(views: Views) -> dict[str, pd.DataFrame] | None:
    """View -> table of `read_truth` with `subject`, frames numbered on; None when a recording has none."""
    truth = {view: [read_truth(recording) for recording in people] for view, people in views.items()}
    if any(table is None for tables in truth.values() for table in tables):
        return None
    return {view: over_people(tables, [*map(len, views[view])]) for view, tables in truth.items()}


def parts_in_image(views: Views, truth: Mapping[str, pd.DataFrame], parts: Parts = PARTS) -> pd.DataFrame:
    """Share of a view's images with parts of the body in the field of view, even if occluded.

    Parameters
    ----------
    views : mapping of str to sequence of Recording
    truth : mapping of str to pd.DataFrame
        As from `true_positions`.
    parts : mapping of str to sequence of str, optional
        Keypoints by part.

    Returns
    -------
    pd.DataFrame
        Columns `view, part, whole, partly`: shares of images with all of a part's keypoints, and with some
        only.
    """
    rows = []
    for view, table in truth.items():
        camera = views[view][0].intrinsics
        inside = table.assign(inside=camera.contains(table[PIXEL].to_numpy()))
        for part, keypoints in parts.items():
            shares = inside[inside["keypoint"].isin(keypoints)].groupby("frame")["inside"].mean()
            rows.append((view, part, (shares == 1).mean(), shares.between(0, 1, "neither").mean()))
    return pd.DataFrame(rows, columns=["view", "part", "whole", "partly"])


def robot_body(views: Mapping[str, Recording]) -> Shape | None:
    """The robot in the first view's first frame (base frame); None if joints are unknown."""
    recording = next(iter(views.values()))
    joints, columns = read_joints(recording), [f"{name}_rad" for name in HEAD_JOINTS]
    if joints is None or not set(columns) <= set(joints):
        return None
    head_rad = joints.set_index("frame").loc[0, columns].to_numpy(float)
    return robot_shape(load_icub(), Posture(head_rad[:3], head_rad[3:]), "level")
