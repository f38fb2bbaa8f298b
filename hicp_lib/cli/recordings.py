"""Commands for recordings of an RGB-D camera on a robot: `hicp record ...` and `hicp lift`."""

import sys
from pathlib import Path

import click

from hicp_lib.cli.options import (
    PATH,
    FiniteRange,
    detector_options,
    given,
    people_option,
    say,
    worker_options,
)
from hicp_lib.core.files import write_table
from hicp_lib.core.folders import filled_folder, locked_folder


@click.group()
def record() -> None:
    """Recordings of colour, depth and camera poses."""


@record.command("simulate")
@click.argument("scenario", metavar="relative-upper|relative-lower|mocap")
@click.argument("out", type=PATH)
@click.option("--n-frames", type=click.IntRange(min=1), help="The scenario's own number if not given.")
@click.option("--seed", default=0, show_default=True, type=click.IntRange(min=0))
@click.option("--subject", "number", default=0, show_default=True, type=click.IntRange(min=0), help="Person.")
@people_option
@click.option("--depth-camera", "camera", default="d435", show_default=True, help="d435 or azure-kinect.")
@worker_options("Processes")
def simulate(
    scenario: str, out: Path, n_frames: int | None, seed: int, number: int, people: str, camera: str, workers
) -> None:
    """Simulate a recording into the folder OUT.

    The relative scenarios show a seated person from many poses of the robot, mocap a moving person with
    motion capture. Finished frames are kept: after an interruption, the same command does only the rest.
    """
    from hicp_lib.experiments.recordings.simulate import simulate_recording
    from hicp_lib.simulation.body.identities import Subject

    subject = Subject(seed, number, people.replace("-", " "))
    name = scenario if camera == "d435" else f"{scenario}@{camera}"
    recording = simulate_recording(out, name, n_frames, subject, workers, progress=sys.stderr.isatty())
    click.echo(f"{out}: {len(recording)} frames")


@record.command("check")
@click.argument("folder", type=PATH, metavar="DIR")
def check(folder: Path) -> int:
    """Say what is missing or inconsistent in the recording in DIR, one line each.

    Exit code 2 if it cannot be used as it is.
    """
    from hicp_lib.recordings.check import check_recording
    from hicp_lib.recordings.recording import open_recording

    findings = check_recording(folder)
    for finding in findings:
        click.echo(f"{'FAIL' if finding.is_fatal else 'note'} {finding}")
    if any(finding.is_fatal for finding in findings):
        return 2
    recording = open_recording(folder)
    duration_s = recording.times_s[-1] - recording.times_s[0]
    click.echo(f"ok   {folder}: {len(recording)} frames in {duration_s:.1f} s")
    return 0


def pose_options(command):
    """Options for poses that were not recorded with the images."""
    for option in (
        click.option("--mount", default="level", show_default=True, type=click.Choice(["level", "tilted"]),
                     help="Camera holder, for joints."),
        click.option("--poses", type=PATH,
                     help="Camera poses (TUM text; one line: static camera), or joints (CSV)."),
    ):  # fmt: skip
        command = option(command)
    return command


@record.command("import")
@click.argument("out", type=PATH)
@click.option("--bag", type=PATH, help="A bag of ROS 1, ROS 2 or RealSense: file, or ROS 2's folder.")
@click.option("--color-topic", help="Topic of colour, where a bag has several.")
@click.option("--depth-topic", help="Topic of depth, where a bag has several.")
@click.option("--base-frame", help="Camera poses in this frame, from the bag's transforms.")
@click.option("--joint-states", is_flag=True, help="Camera poses from the iCub's joint angles in the bag.")
@click.option("--open3d", "folder", type=PATH, help="A folder with color/, depth/ and intrinsic.json.")
@click.option("--rate", type=FiniteRange(min=0, min_open=True), help="Frames per second of a folder.")
@click.option("--depth-scale", type=FiniteRange(min=1), help="Depth units per metre of a folder.")
@pose_options
def import_(
    out, bag, color_topic, depth_topic, base_frame, joint_states, folder, rate, depth_scale, poses, mount
):
    """Make a recording in the folder OUT from files of ROS, RealSense or Open3D tools.

    Without --poses, --base-frame or --joint-states the camera's own frame is the base frame.
    """
    from hicp_lib.recordings.importing import import_open3d
    from hicp_lib.recordings.trajectories import read_pose_source

    if (bag is None) == (folder is None):
        raise click.UsageError("Give either --bag FILE or --open3d DIR.", click.get_current_context())
    if sum(map(bool, (poses, base_frame, joint_states))) > 1:
        message = "Give one of --poses, --base-frame and --joint-states."
        raise click.UsageError(message, click.get_current_context())
    of_bag = {"color-topic": color_topic, "depth-topic": depth_topic, "base-frame": base_frame,
              "joint-states": joint_states or None}  # fmt: skip
    others, only = (of_bag, "bag") if bag is None else ({"rate": rate, "depth-scale": depth_scale}, "open3d")
    if unused := [f"--{name}" for name, value in others.items() if value is not None]:
        message = f"{unused[0]} goes with --{only} only; leave it out."
        raise click.UsageError(message, click.get_current_context())
    source = read_pose_source(poses, mount)
    with filled_folder(out) as inner:
        if bag is not None:
            from hicp_lib.recordings.bags import import_bag

            topics, joints_mount = (color_topic, depth_topic), mount if joint_states else None
            n, notes = import_bag(bag, inner, source, topics, base_frame, joints_mount)
        else:
            n, notes = import_open3d(folder, inner, source, rate, depth_scale)
    _tell(out, n, notes)


def _tell(out: Path, n_frames: int, notes: list[str]) -> None:
    for note in notes:
        say(note)
    click.echo(f"{out}: {n_frames} frames; check them with: hicp record check {out}")


@record.command("camera")
@click.argument("out", type=PATH)
@click.option("--color", "color_px", nargs=2, type=int, default=(640, 480), help="Width, height: 640 480.")
@click.option("--depth", "depth_px", nargs=2, type=int, default=(848, 480), help="Width, height: 848 480.")
@click.option("--rate", "rate_hz", default=30, show_default=True, type=int, help="Frames per second.")
@click.option("--seconds", "duration_s", type=FiniteRange(min=0), help="Until Ctrl-C if not given.")
@click.option("--joints", type=click.File(), help="Lines of joint angles; - is standard input.")
@pose_options
def camera(out: Path, joints, poses: Path | None, mount: str, **settings) -> None:
    """Record from a RealSense into the folder OUT, until Ctrl-C; the raw streams stay in OUT.db3."""
    from hicp_lib.recordings.realsense import record_camera
    from hicp_lib.recordings.trajectories import read_pose_source

    if joints and poses:
        raise click.UsageError("Give either --poses FILE or --joints FILE.", click.get_current_context())
    with locked_folder(out):
        n, notes = record_camera(out, read_pose_source(poses, mount), joints, mount, **settings)
    _tell(out, n, notes)


@click.command()
@click.option("--recording", "folder", type=PATH, required=True, help="Folder of the recording.")
@detector_options
@click.option("--method", default="robust", show_default=True, type=click.Choice(["robust", "paper"]))
@click.option("--out", type=PATH, required=True, help="Table to write: FILE.parquet, or FILE.csv.")
@worker_options("Threads")
def lift(folder: Path, detector: str, method: str, out: Path, workers: int | str | None, **chosen) -> None:
    """Find people in a recording, and lift their keypoints to the robot's base frame."""
    from hicp_lib.detectors.registry import make_detector
    from hicp_lib.detectors.runtime.results import detections_of
    from hicp_lib.detectors.runtime.run import detect_images
    from hicp_lib.formats.detection_files import refuse_other_suffix
    from hicp_lib.lifting.table import lift_recording
    from hicp_lib.recordings.recording import RGB_LIST, colour_files, open_recording
    from hicp_lib.recordings.tum import MAX_DIFFERENCE_S, read_file_list

    refuse_other_suffix(out, (".parquet", ".csv"))
    recording = open_recording(folder)
    paths, n_all = colour_files(recording), len(read_file_list(folder / RGB_LIST)[0])
    if n := n_all - len(recording):
        lacking = f"have no depth or no pose within {MAX_DIFFERENCE_S:g} s"
        say(f"{folder / RGB_LIST}: {n} of {n_all} colour images {lacking} and are left out")
    options = given(**chosen)
    made = make_detector(detector, **options)  # refuses what is none of its options
    found = detect_images(detector, paths, workers, **options)
    del made  # until here, since the runs share its open network
    table = lift_recording(recording, list(detections_of(found).values()), method)
    write_table(out, table)
    n_lifted = table["x_m"].notna().sum()
    click.echo(f"{out}: {n_lifted} of {len(table)} keypoints in {len(recording)} frames lifted")
