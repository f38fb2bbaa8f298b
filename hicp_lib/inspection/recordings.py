"""What a bag or the folder of a recording holds."""

from pathlib import Path

import numpy as np

from hicp_lib.core.errors import InputError
from hicp_lib.inspection.facts import Facts, about_times
from hicp_lib.recordings.bag_file import open_bag
from hicp_lib.recordings.bag_streams import Stream, find_streams
from hicp_lib.recordings.check import check_recording
from hicp_lib.recordings.recording import Recording, open_recording

_MOCAP = ("mocap.tsv", "mocap.c3d")


def inspect_bag(path: Path) -> Facts:
    """Say what a bag holds.

    Parameters
    ----------
    path : Path
        A file, or the folder of a ROS 2 bag.

    Returns
    -------
    Facts

    Raises
    ------
    InputError
        If it cannot be read.
    """
    with open_bag(path) as bag:
        reader = bag.reader
        counts = {connection.topic: connection.msgcount for connection in reader.connections}
        says = {
            "messages": f"{reader.message_count} on {len(counts)} topics",
            "times": f"{reader.duration / 1e9:.2f} s as recorded; images by their headers' stamps",
        }
        poses = bag.topics("TFMessage", "JointState")
        try:
            color, depth = find_streams(bag, (None, None))
        except InputError as error:
            says["topics"] = ", ".join(list(counts)[:8])
            return Facts(path, "bag", says, problem=str(error).removeprefix(f"{path}: "))
        says["colour"], says["depth"] = (_stream(of, counts) for of in (color, depth))
        says["poses"] = ", ".join(poses) if poses else "none in the bag"
        needed = "--base-frame or --joint-states" if poses else "--poses, unless the camera stands still"
        return Facts(path, "bag", says, needs={"hicp record import": needed})


def _stream(stream: Stream, counts: dict[str, int]) -> str:
    camera = stream.camera
    distorted = "" if stream.pixels_px is None else ", distorted (undone on import)"
    size = f"{camera.width_px} x {camera.height_px}, focal length {camera.fx_px:.1f} px"
    return f"{stream.topic}: {counts[stream.topic]} images, {size}, frame {stream.frame!r}{distorted}"


def inspect_recording(folder: Path) -> Facts:
    """Say what the folder of a recording holds; every image is read.

    Parameters
    ----------
    folder : Path

    Returns
    -------
    Facts
    """
    findings = check_recording(folder)
    fatal = [str(finding) for finding in findings if finding.is_fatal]
    notes = [str(finding) for finding in findings if not finding.is_fatal]
    if fatal:
        return Facts(folder, "recording", notes=notes + fatal[1:], problem=fatal[0])
    recording = open_recording(folder)
    camera = recording.intrinsics
    mocap = [name for name in _MOCAP if (folder / name).is_file()]
    says = {
        "frames": f"{len(recording)} of {camera.width_px} x {camera.height_px} pixels",
        "depth": f"{recording.depth_units_per_m:g} units per metre",
        "times": about_times(recording.times_s, "seconds, when images were taken"),
        "poses": f"camera to base; moved {_moved_m(recording):.3f} m",
        "motion capture": ", ".join(mocap) or "none",
    }
    needs = {"hicp lift": "--detector", "the relative 3D test": ""}
    needs["the 3D error against motion capture"] = "" if mocap else "mocap.tsv or mocap.c3d"
    return Facts(folder, "recording of an RGB-D camera", says, notes, needs)


def _moved_m(recording: Recording) -> float:
    return float(np.linalg.norm(np.ptp(recording.T_base_cam[:, :3, 3], axis=0)))
