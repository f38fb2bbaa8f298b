"""What recordings hold, and files of them: bags, cameras, trajectories, motion capture."""

from pathlib import Path

import numpy as np
import pandas as pd

from hicp_lib.core.errors import InputError, one_line
from hicp_lib.core.files import read_json
from hicp_lib.inspection.facts import ORIGIN, Facts, about_times
from hicp_lib.mocap.registration import read_registration
from hicp_lib.recordings.bag_file import Bag, open_bag
from hicp_lib.recordings.bag_streams import Stream, find_streams
from hicp_lib.recordings.camera_file import read_distorted_camera
from hicp_lib.recordings.check import FURTHEST_POSE_M, check_recording
from hicp_lib.recordings.importing import read_pose_source
from hicp_lib.recordings.qualisys import read_mocap
from hicp_lib.recordings.recording import open_recording
from hicp_lib.recordings.trajectories import read_trajectory
from hicp_lib.recordings.tum import count_repeated, doubt, names_poses, read_file_list

_CAMERA_FILES = ("intrinsic.json", "camera_intrinsic.json")
_OPTIONS = {"fps": "--rate", "depth_scale": "--depth-scale"}


def describe_bag(path: Path) -> Facts:
    """Say what a bag holds: a file, or the folder of one of ROS 2."""
    with open_bag(path) as bag:
        counts = {connection.topic: connection.msgcount for connection in bag.reader.connections}
        says = {"messages": f"{bag.reader.message_count} on {len(counts)} topics"}
        try:
            color, depth = find_streams(bag, (None, None))
        except InputError as error:
            says["topics"] = ", ".join(list(counts)[:8])
            return Facts(says, problem=str(error).removeprefix(f"{path}: "))
        for name, stream in (("colour", color), ("depth", depth)):
            says[name] = _stream(bag, stream, counts[stream.topic])
        poses = bag.topics("TFMessage", "JointState")
        says |= {"depth unit": f"{depth.units_per_m:g} per metre", "poses": ", ".join(poses) or "none"}
        needed = "--base-frame or --joint-states" if poses else "--poses, unless the camera stands still"
        return Facts(
            says, [*dict.fromkeys(color.notes + depth.notes)], {"hicp record import": f"--bag; {needed}"}
        )


def _stream(bag: Bag, stream: Stream, n: int) -> str:
    camera, lasts_s = stream.camera, bag.reader.duration / 1e9
    rate = f"about {n / lasts_s:.3g} per second for {lasts_s:.2f} s" if lasts_s else "all at one time"
    size = f"{camera.width_px} x {camera.height_px}, focal length {camera.fx_px:.1f} px"
    return f"{n} on {stream.topic}, {rate} by recording's clock, times from headers; {size}"


def describe_recording(folder: Path) -> Facts:
    """Say what the folder of a recording holds; every image is read."""
    findings = check_recording(folder)
    fatal, notes = ([str(of) for of in findings if of.is_fatal == wanted] for wanted in (True, False))
    if fatal:
        return Facts(notes=fatal[1:] + notes, problem=fatal[0])
    recording = open_recording(folder)
    camera, mocap = recording.intrinsics, recording.mocap_path
    says = {
        "frames": f"{len(recording)} of {camera.width_px} x {camera.height_px} pixels",
        "depth": f"{recording.depth_units_per_m:g} units per metre",
        "times": about_times(recording.times_s, "seconds, when images were taken"),
        "poses": f"camera to base, metres; {_moved(recording.T_base_cam)}",
        "motion capture": mocap.name if mocap else "none",
    }
    needed = "" if mocap else "mocap.tsv or mocap.c3d in it"
    return Facts(says, notes, {"errors against motion capture": needed})


def describe_open3d(folder: Path) -> Facts:
    """Say what a folder with `color/` and `depth/` holds."""
    counts = {name: len(list((folder / name).iterdir())) for name in ("color", "depth")}
    says = {"images": ", ".join(f"{name} {n}" for name, n in counts.items())}
    path = next((folder / name for name in _CAMERA_FILES if (folder / name).is_file()), None)
    if path is None:
        return Facts(says, needs={"hicp record import": f"--open3d; {' or '.join(_CAMERA_FILES)} in it"})
    facts, content = describe_camera(path), read_json(path)
    said = f"{content['fps']} per second" if "fps" in content else "not known"
    says |= {"times": f"{said}, as {path.name} says; none of each image"} | facts.says
    missing = [option for key, option in _OPTIONS.items() if key not in content]
    needs = {"hicp record import": " ".join(["--open3d", *missing, "--poses, unless it stands still"])}
    problem = "" if counts["color"] == counts["depth"] else "expected one depth image per colour"
    return Facts(says, facts.notes, needs, problem)


def describe_camera(path: Path) -> Facts:
    """Say what a file of a camera's intrinsics holds."""
    scale = read_json(path).get("depth_scale")
    camera, _, distorted_px = read_distorted_camera(path, 1.0 if scale is None else None)
    says = {
        "image": f"{camera.width_px} x {camera.height_px} pixels, {ORIGIN}",
        "focal lengths": f"{camera.fx_px:.2f}, {camera.fy_px:.2f} pixels",
        "principal point": f"{camera.cx_px:.2f}, {camera.cy_px:.2f} pixels",
        "depth": f"{scale:g} units per metre" if scale else "its unit is not in the file",
        "distortion": "none" if distorted_px is None else "some; undone on import",
    }
    return Facts(says, needs={} if scale else {"hicp record import": "--depth-scale"})


def describe_registration(path: Path) -> Facts:
    """Say what the registration of motion capture says."""
    place_m = read_registration(path).T_base_mocap[:3, 3]
    return Facts(
        {"units": "metres, motion capture to the robot's base; at {:.3f}, {:.3f}, {:.3f}".format(*place_m)}
    )


def describe_mocap(path: Path) -> Facts:
    """Say what a file of motion capture holds."""
    mocap = read_mocap(path)
    seen = np.isfinite(mocap.points_m).all(axis=-1)
    extent_m = np.ptp(mocap.points_m[seen], axis=0) if seen.any() else np.zeros(3)
    says = {
        "markers": f"{len(mocap.names)}: {', '.join(mocap.names[:12])}{' ...' * (len(mocap.names) > 12)}",
        "frames": f"{len(mocap.times_s)}; markers seen in {100 * seen.sum() / max(seen.size, 1):.1f} %",
        "units": "metres once read; extent {:.2f} x {:.2f} x {:.2f}".format(*extent_m),
        "times": about_times(mocap.times_s, f"the system's own clock, {mocap.rate_hz:g} Hz stated"),
    }
    return Facts(says)


def describe_list(path: Path) -> Facts:
    """Say what a list of images holds."""
    times_s, names = read_file_list(path)
    missing = sum(not (path.parent / name).is_file() for name in names)
    says = {"images": f"{len(names)}" + f"; {missing} of them are not there" * bool(missing)}
    says["times"] = about_times(times_s, "seconds, when each image was taken")
    return Facts(says, _doubts(path, times_s))


def describe_trajectory(path: Path) -> Facts:
    """Say what a file of a camera's poses holds."""
    times_s, T_base_cam = read_trajectory(path)
    says = {
        "poses": f"{len(T_base_cam)}, camera to the file's own world",
        "units": f"metres; {_moved(T_base_cam)}",
    }
    says["times"] = about_times(times_s, "seconds once read")
    furthest_m = np.linalg.norm(T_base_cam[:, :3, 3], axis=1).max()
    far = f"up to {furthest_m:.4g} m from its origin, more than a robot reaches; are these millimetres?"
    notes = _doubts(path, times_s) + [far] * bool(furthest_m > FURTHEST_POSE_M)
    as_joints = path.suffix.lower() == ".csv" and not names_poses(path)
    return Facts(
        says, notes + ["as --poses, .csv is taken for joint angles: end its name in .txt"] * as_joints
    )


def describe_joints(path: Path) -> Facts:
    """Say what a table of the robot's joint angles holds."""
    times_s, _ = read_pose_source(path)
    return Facts({"rows": str(len(times_s)), "units": "degrees", "times": about_times(times_s, "seconds")})


def describe_clicks(path: Path) -> Facts:
    """Say what a table of clicked markers holds."""
    try:
        table = pd.read_csv(path, skipinitialspace=True).astype({"frame": int, "u_px": float, "v_px": float})
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: is no table of clicks ({one_line(error)})") from None
    markers, frames = table["marker"].nunique(), table["frame"].nunique()
    return Facts(
        {"clicks": f"{len(table)} on {markers} markers in {frames} frames", "units": f"pixels, {ORIGIN}"}
    )


def _moved(T_base_cam: np.ndarray) -> str:
    return "moved {:.3f} x {:.3f} x {:.3f}".format(*np.ptp(T_base_cam[:, :3, 3], axis=0))


def _doubts(path: Path, times_s: np.ndarray) -> list[str]:
    n = count_repeated(path) if len(times_s) else 0
    return [
        *filter(None, [doubt(times_s), f"{n} lines repeat the time before and are passed over" * bool(n)])
    ]
