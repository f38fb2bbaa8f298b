"""Record from a RealSense: librealsense writes a bag, which is then converted to a recording.

The bag contains the camera's raw streams, so that nothing is lost if the import is interrupted.
"""

import time
from collections.abc import Iterable
from pathlib import Path
from threading import Event, Thread
from typing import Any

import numpy as np

from hicp_lib.core.errors import InputError, one_line
from hicp_lib.core.extras import needs, require
from hicp_lib.core.folders import refuse_used_folder
from hicp_lib.recordings.bags import import_bag
from hicp_lib.recordings.writer import Poses

_N_JOINTS = 6
Size = tuple[int, int]
Mode = tuple[int, int, int]
"""Width and height, and frames per second."""


def record_camera(
    out: str | Path,
    poses: Poses | None = None,
    joint_lines: Iterable[str] | None = None,
    mount: str = "level",
    color_px: Size = (640, 480),
    depth_px: Size = (848, 480),
    rate_hz: int = 30,
    duration_s: float | None = None,
    device: Any = None,
) -> tuple[int, list[str]]:
    """Record from a RealSense until Ctrl-C.

    The bag it was made from is kept as `OUT.db3`.

    Parameters
    ----------
    out : str or Path
        Folder of the recording; new or empty.
    poses : tuple of array, optional
        As `read_pose_source` gives them.
    joint_lines : iterable of str, optional
        Instead of `poses`: lines of joint angles as they arrive (`read_joints_line`).
    mount : str, optional
        Camera holder, for joints.
    color_px, depth_px : (int, int), optional
        Width and height.
    rate_hz : int, optional
    duration_s : float, optional
        Ends automatically after this time.
    device : Any, optional
        pyrealsense2's; by default the first connected one.

    Returns
    -------
    n_frames : int
    notes : list of str
        As of `import_bag`.

    Raises
    ------
    InputError
        If there is no camera, or it lacks these sizes; if it stops; afterwards, if a line of joints is
        malformed.
    """
    require("bags", "rosbags")
    with needs("camera"):
        import pyrealsense2 as rs
    bag = Path(f"{out}.db3")
    refuse_used_folder(Path(out))
    if bag.exists():
        raise InputError(f"{bag}: is there already; give another folder, or import it with --bag")
    bag.parent.mkdir(parents=True, exist_ok=True)
    lines: list[tuple[float, str]] = []
    arrivals = ((time.time(), line) for line in joint_lines or ())
    Thread(target=lines.extend, args=(arrivals,), daemon=True).start()
    modes = {"color": (*color_px, rate_hz), "depth": (*depth_px, rate_hz)}
    try:
        _record(rs, device, bag, modes, duration_s)
    except RuntimeError as error:
        raise InputError(f"{bag}: RealSense: {one_line(error)}") from None
    try:
        return import_bag(bag, out, poses if joint_lines is None else _joint_poses(lines, mount))
    except InputError as error:
        raise InputError(f"{error}; what was recorded is in {bag}") from None


def read_joints_line(line: str, arrival_s: float) -> tuple[float, list[float]]:
    """Time and joint angles of a line of text.

    Six numbers, in degrees: torso pitch, roll, yaw, neck pitch, roll, yaw; or, as YARP prints them with their
    envelope, a count, a time in seconds and those six. Brackets are ignored.

    Parameters
    ----------
    line : str
    arrival_s : float
        Time of its arrival, in seconds since 1970.

    Returns
    -------
    time_s : float
        Time of arrival if the line has none.
    angles_deg : list of float
        Six.

    Raises
    ------
    InputError
        If the line is malformed.

    Examples
    --------
    >>> read_joints_line("7 1700000000.5 (10 0 0 -20 0 5)", 1700000000.6)
    (1700000000.5, [10.0, 0.0, 0.0, -20.0, 0.0, 5.0])
    """
    try:
        values = [float(field) for field in line.translate(str.maketrans("(),", "   ")).split()]
    except ValueError:
        values = []
    if len(values) not in (_N_JOINTS, _N_JOINTS + 2) or not np.isfinite(values).all():
        expected = "six angles in degrees, or a count and a time before them"
        raise InputError(f"joints: expected lines of {expected}; found {line.strip()[:60]!r}")
    return arrival_s if len(values) == _N_JOINTS else values[1], values[-_N_JOINTS:]


def _joint_poses(lines: list[tuple[float, str]], mount: str) -> Poses:
    from hicp_lib.robot.kinematics import load_icub  # not in every installation

    if not lines:
        raise InputError("joints: no lines arrived; expected six angles in degrees in each")
    stamps_s, angles_deg = zip(*(read_joints_line(line, arrival_s) for arrival_s, line in lines), strict=True)
    times_s, first = np.unique(stamps_s, return_index=True)
    if len(times_s) < 2:
        still = "for a robot that stands still give --poses FILE instead"
        raise InputError(f"joints: lines of only one time arrived; expected one line for each image; {still}")
    return times_s, load_icub().T_root_camera(np.radians(angles_deg)[first], mount)


def _record(rs: Any, device: Any, bag: Path, modes: dict[str, Mode], duration_s: float | None) -> None:
    devices = rs.context().query_devices() if device is None else [device]
    if len(devices) == 0:
        raise InputError("no RealSense is connected; see what rs-enumerate-devices lists")
    recorder, sensors = rs.recorder(str(bag), devices[0]), []
    try:
        for stream, mode in modes.items():
            sensor, profile = _profile(rs, recorder, stream, mode)
            if sensor.supports(rs.option.global_time_enabled):
                sensor.set_option(rs.option.global_time_enabled, 1)
            sensor.open(profile)
            sensor.start(lambda frame: None)
            sensors.append(sensor)
        Event().wait(duration_s)
    except KeyboardInterrupt:
        pass  # the normal end of a recording
    finally:
        for sensor in sensors:
            sensor.stop()
            sensor.close()


def _profile(rs: Any, device: Any, stream: str, mode: Mode) -> tuple[Any, Any]:
    """The sensor that has a stream, and its profile of that size and rate."""
    wanted = (rs.stream.color, rs.format.rgb8) if stream == "color" else (rs.stream.depth, rs.format.z16)
    known = {}
    for sensor in device.query_sensors():
        for profile in sensor.get_stream_profiles():
            if (profile.stream_type(), profile.format()) == wanted:
                video = profile.as_video_stream_profile()
                known[video.width(), video.height(), video.fps()] = sensor, profile
    if mode not in known:
        modes = ", ".join(map(_shown, sorted(known))) or "none"
        raise InputError(f"the camera has no {stream} of {_shown(mode)}; it has {modes}")
    return known[mode]


def _shown(mode: Mode) -> str:
    return "{}x{} at {} Hz".format(*mode)
