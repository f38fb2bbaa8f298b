"""Describe recordings and their files: bags, cameras, trajectories, motion capture."""

from collections.abc import Iterable
from dataclasses import asdict
from pathlib import Path

import numpy as np

from hicp_lib.core.camera import Camera
from hicp_lib.core.errors import InputError
from hicp_lib.core.files import read_json
from hicp_lib.core.folders import listed
from hicp_lib.core.limited import limited_child
from hicp_lib.inspection.facts import ORIGIN, Facts, about_times
from hicp_lib.mocap.registration import read_registration
from hicp_lib.recordings.bag_file import open_bag
from hicp_lib.recordings.bag_streams import find_streams
from hicp_lib.recordings.camera_file import read_distorted_camera
from hicp_lib.recordings.check import FURTHEST_POSE_M, check_recording
from hicp_lib.recordings.importing import METADATA
from hicp_lib.recordings.qualisys import read_mocap
from hicp_lib.recordings.recording import open_recording, read_csv
from hicp_lib.recordings.trajectories import read_pose_source, read_trajectory
from hicp_lib.recordings.tum import read_file_list, remarks

_OPTIONS = {"fps": "--rate", "depth_scale": "--depth-scale"}


def describe_bag(path: Path) -> Facts:
    """Say what a bag holds: a file, or the folder of one of ROS 2."""
    return Facts(**limited_child(path, _bag))


def _bag(path: str) -> dict:
    with open_bag(path) as bag:
        counts = {connection.topic: connection.msgcount for connection in bag.reader.connections}
        lasts_s, poses = bag.reader.duration / 1e9, bag.topics("TFMessage", "JointState")
        says = {"messages": f"{bag.reader.message_count} on {len(counts)} topics in {lasts_s:.2f} s"}
        streams = find_streams(bag, (None, None))
    for name, of in zip(("colour", "depth"), streams, strict=True):
        rate = f", about {counts[of.topic] / lasts_s:.3g} per second" if lasts_s else ""
        says[name] = f"{counts[of.topic]} on {of.topic}{rate}, times from headers; {_size(of.camera)}"
    says |= {"depth unit": f"{streams[1].units_per_m:g} per metre", "poses": ", ".join(poses) or "none"}
    needed = "--base-frame or --joint-states" if poses else "--poses, unless the camera stands still"
    notes = [*dict.fromkeys(streams[0].notes + streams[1].notes)]
    return asdict(Facts(says, notes, {"hicp record import": f"--bag; {needed}"}))


def describe_recording(folder: Path) -> Facts:
    """Say what the folder of a recording holds; every image is read."""
    findings = check_recording(folder)
    fatal, notes = ([str(of) for of in findings if of.is_fatal == wanted] for wanted in (True, False))
    if fatal:
        return Facts(notes=fatal[1:] + notes, problem=fatal[0])
    recording = open_recording(folder)
    says = {
        "frames": f"{len(recording)} of {_size(recording.intrinsics)}",
        "depth": f"{recording.depth_units_per_m:g} units per metre",
        "times": about_times(recording.times_s, "seconds, when images were taken"),
        "poses": f"camera to base, moved by {_metres(np.ptp(recording.T_base_cam[:, :3, 3], axis=0))} m",
        "motion capture": recording.mocap_path.name if recording.mocap_path else "none",
    }
    needs = {"errors against motion capture": "" if recording.mocap_path else "mocap.tsv or mocap.c3d in it"}
    return Facts(says, notes, needs)


def describe_open3d(folder: Path) -> Facts:
    """Say what a folder with `color/` and `depth/` holds."""
    n_color, n_depth = (len(listed(folder / name)) for name in ("color", "depth"))
    path = next((path for path in map(folder.joinpath, METADATA) if path.is_file()), None)
    if path is None or n_color != n_depth:
        raise InputError(f"{n_color} and {n_depth} images; expected as many, and one of {METADATA}")
    facts, content = describe_camera(path), read_json(path)
    times = f"{str(content.get('fps', 'not known how many'))[:40]} per second, as {path.name} says"
    missing = "".join(f" {option}" for key, option in _OPTIONS.items() if key not in content)
    needs = {"hicp record import": f"--open3d{missing} --poses, unless the camera stands still"}
    return Facts({"images": f"{n_color} in each", "times": times} | facts.says, facts.notes, needs)


def describe_camera(path: Path) -> Facts:
    """Say what a file of a camera's intrinsics holds."""
    content = read_json(path)
    scale = content.get("depth_scale") if isinstance(content, dict) else None
    camera, _, distorted_px = read_distorted_camera(path, 1.0 if scale is None else None)
    says = {
        "image": _size(camera),
        "principal point": f"{camera.cx_px:.2f}, {camera.cy_px:.2f}; {ORIGIN}",
        "depth": f"{scale:g} units per metre" if scale else "its unit is not in the file",
        "distortion": "none" if distorted_px is None else "some; undone on import",
    }
    return Facts(says, needs={} if scale else {"hicp record import": "--depth-scale"})


def describe_registration(path: Path) -> Facts:
    """Say what the registration of motion capture says."""
    place_m = read_registration(path).T_base_mocap[:3, 3]
    return Facts({"units": f"metres, motion capture to the robot's base; at {_metres(place_m)}"})


def describe_mocap(path: Path) -> Facts:
    """Say what a file of motion capture holds."""
    mocap = read_mocap(path)
    seen = np.isfinite(mocap.points_m).all(axis=-1)
    extent_m = np.ptp(mocap.points_m[seen], axis=0) if seen.any() else []
    says = {
        "markers": f"{len(mocap.names)}: {', '.join(mocap.names[:12])}",
        "frames": f"{len(mocap.times_s)}; markers seen in {100 * seen.sum() / max(seen.size, 1):.1f} %",
        "units": f"metres once read; extent {_metres(extent_m)}",
        "times": about_times(mocap.times_s, f"the system's own clock, {mocap.rate_hz:g} Hz stated"),
    }
    return Facts(says)


def describe_list(path: Path) -> Facts:
    """Say what a list of images holds."""
    times_s, names = read_file_list(path)
    n_missing = sum(not (path.parent / name).is_file() for name in names)
    says = {"images": f"{len(names)}, of which {n_missing} are not there"}
    says["times"] = about_times(times_s, "seconds, when each image was taken")
    return Facts(says, remarks(path, times_s))


def describe_poses(path: Path, by: str = "") -> Facts:
    """Say what a file of a camera's poses holds, or of joint angles by which it moves."""
    times_s, T_base_cam = read_pose_source(path) if by else read_trajectory(path)
    place_m = T_base_cam[:, :3, 3]
    says = {
        "poses": f"{len(place_m)}, camera to {by or 'the file'}'s world",
        "times": about_times(times_s, "seconds"),
    }
    says["units"] = f"metres; moved by {_metres(np.ptp(place_m, axis=0))}"
    furthest_m = np.linalg.norm(place_m, axis=1).max()
    far = f"up to {furthest_m:.4g} m from its origin, more than a robot reaches; are these millimetres?"
    return Facts(
        says, (remarks(path, times_s) if len(times_s) else []) + [far] * int(furthest_m > FURTHEST_POSE_M)
    )


def describe_clicks(path: Path) -> Facts:
    """Say what a table of clicked markers holds."""
    table = read_csv(path, ["frame", "u_px", "v_px"], ["marker"])
    counts = f"{len(table)} on {table['marker'].nunique()} markers in {table['frame'].nunique()} frames"
    return Facts({"clicks": counts, "units": f"pixels, {ORIGIN}"})


def _size(of: Camera) -> str:
    return f"{of.width_px} x {of.height_px} pixels, focal lengths {of.fx_px:.2f}, {of.fy_px:.2f}"


def _metres(xyz_m: Iterable[float]) -> str:
    return ", ".join(f"{along:.3f}" for along in xyz_m)
