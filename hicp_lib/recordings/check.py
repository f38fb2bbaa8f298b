"""Find what is missing or inconsistent in a recording, one line each."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from hicp_lib.core.errors import InputError
from hicp_lib.recordings import recording as rec
from hicp_lib.recordings.camera_file import read_camera
from hicp_lib.recordings.recording import Recording
from hicp_lib.recordings.tum import MAX_DIFFERENCE_S, associate, read_file_list, read_poses, remarks

PLAUSIBLE_DEPTH_M = (0.1, 12.0)  # of the median depth that a camera near a robot sees
FURTHEST_POSE_M = 10.0  # from the base: a robot's reach is less, a pose in millimetres is more
MIN_COVERED = 0.9  # fraction of the images' time that motion capture must cover


@dataclass(frozen=True)
class Finding:
    """One line about a recording.

    Attributes
    ----------
    text : str
    is_fatal : bool
        Whether the recording cannot be used as it is.

    Examples
    --------
    >>> print(Finding("rgb.txt: holds no lines"))
    rgb.txt: holds no lines
    """

    text: str
    is_fatal: bool = True

    def __str__(self) -> str:
        return self.text


def check_recording(folder: str | Path) -> list[Finding]:
    """Everything wrong with a recording. Reads every image.

    Parameters
    ----------
    folder : str or Path

    Returns
    -------
    list of Finding
        One each; empty if all is well.

    Examples
    --------
    >>> [str(finding) for finding in check_recording("nowhere")]
    ['nowhere: is not a folder; give the folder of a recording']
    """
    folder, findings = Path(folder), _Findings()
    if not folder.is_dir():
        return [Finding(f"{folder}: is not a folder; give the folder of a recording")]
    _check_files(findings, folder)
    if not any(finding.is_fatal for finding in findings):
        recording = rec.open_recording(folder)
        for read in (rec.read_truth, rec.read_joints):
            findings.attempt(read, recording)
        for check in (_check_images, _check_poses, _check_mocap):
            check(findings, recording)
    return list(findings)


class _Findings(list[Finding]):
    def note(self, path: Path, text: str, is_fatal: bool = False) -> None:
        self.append(Finding(f"{path}: {text}", is_fatal))

    def attempt(self, read: Callable, *arguments: object) -> Any:
        """The result of reading; on an error None, and a finding is added."""
        try:
            return read(*arguments)
        except InputError as error:
            self.append(Finding(str(error)))
            return None


def _check_files(findings: _Findings, folder: Path) -> None:
    """Missing or malformed text files, missing images, unpaired images."""
    findings.attempt(read_camera, folder / rec.CAMERA_FILE)
    lists = [findings.attempt(read_file_list, folder / name) for name in (rec.RGB_LIST, rec.DEPTH_LIST)]
    for _, names in filter(None, lists):
        missing = [name for name in names if not (folder / name).is_file()]
        if missing:
            text = f"is not there; {len(missing)} of {len(names)} listed are not"
            findings.note(folder / missing[0], text, is_fatal=True)
    poses = findings.attempt(read_poses, folder / rec.POSES_FILE)
    for name, read in zip((rec.RGB_LIST, rec.DEPTH_LIST, rec.POSES_FILE), (*lists, poses), strict=True):
        for text in remarks(folder / name, read[0]) if read else ():
            findings.note(folder / name, text)
    if poses and all(lists):
        _check_association(findings, folder, [times_s for times_s, _ in filter(None, [*lists, poses])])


def _check_association(findings: _Findings, folder: Path, times_s: Sequence[np.ndarray]) -> None:
    rgb_s, depth_s, pose_s = times_s
    is_fatal = len(rec.associate_frames(rgb_s, depth_s, pose_s)[0]) == 0
    for name, other_s in (("depth image", depth_s), ("pose", pose_s)):
        n = len(rgb_s) - len(associate(rgb_s, other_s)[0])
        if n:
            text = f"{n} of {len(rgb_s)} colour images have no {name} within {MAX_DIFFERENCE_S:g} s"
            findings.note(folder / rec.RGB_LIST, f"{text} and are left out", is_fatal)


def _check_images(findings: _Findings, recording: Recording) -> None:
    """Images that cannot be read, are not of the right kind, or have another size; implausible depth."""
    middles_m = []
    for kind, read in (("colour", rec.read_rgb), ("depth", rec.read_depth_m)):
        bad = _Findings()
        for k in range(len(recording)):
            image = bad.attempt(read, recording, k)
            if kind == "depth" and image is not None:
                middles_m.append(np.median(image[image > 0]) if (image > 0).any() else np.nan)
        if bad:
            findings.append(Finding(f"{bad[0]} ({len(bad)} of {len(recording)} {kind} images are unusable)"))
    n, n_empty = len(middles_m), int(np.isnan(middles_m).sum())
    if n_empty:
        text = f"{n_empty} of {n} depth images hold no depth at all"
        findings.note(recording.folder / rec.DEPTH_LIST, text, is_fatal=n_empty == n)
    low, high = PLAUSIBLE_DEPTH_M
    if n_empty < n and not low <= (middle := np.nanmedian(middles_m)) <= high:
        scale = f"with depth_scale {recording.depth_units_per_m:g} the middle depth is {middle:.3g} m"
        text = f"{scale}; expected {low:g} to {high:g} m, correct the scale"
        findings.note(recording.folder / rec.CAMERA_FILE, text)


def _check_poses(findings: _Findings, recording: Recording) -> None:
    furthest_m = np.linalg.norm(recording.T_base_cam[:, :3, 3], axis=1).max()
    if furthest_m > FURTHEST_POSE_M:
        text = f"the camera is up to {furthest_m:.4g} m from the base; expected metres, not millimetres"
        findings.note(recording.folder / rec.POSES_FILE, text)


def _check_mocap(findings: _Findings, recording: Recording) -> None:
    """Motion capture that cannot be read, does not cover the recording, or lacks a marker."""
    from hicp_lib.recordings.qualisys import read_mocap  # ezc3d takes a while to load

    path, images_s = recording.mocap_path, recording.times_s
    mocap = None if path is None else findings.attempt(read_mocap, path)
    if path is None or mocap is None:
        return
    lasts_s, images_last_s = np.ptp(mocap.times_s), np.ptp(images_s)
    if lasts_s < MIN_COVERED * images_last_s:
        findings.note(path, f"lasts {lasts_s:.2f} s, the images {images_last_s:.2f} s; export it whole")
    if mocap.times_s[-1] < images_s[0] or mocap.times_s[0] > images_s[-1]:
        findings.note(path, "does not overlap with the images in time; its clock is another")
    never = [n for k, n in enumerate(mocap.names) if np.isnan(mocap.points_m[:, k]).any(axis=1).all()]
    if never:
        findings.note(path, f"{', '.join(never)} never seen ({len(never)} of {len(mocap.names)} markers)")
