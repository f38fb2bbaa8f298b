"""Recordings and files of them; names mislead on purpose."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pandas as pd

from hicp_lib.core.camera import Camera
from hicp_lib.recordings.c3d import write_c3d
from hicp_lib.recordings.camera_file import write_camera
from hicp_lib.recordings.qualisys import MotionCapture, write_tsv
from hicp_lib.recordings.tum import write_file_list, write_poses
from hicp_lib.robot.kinematics import HEAD_JOINTS
from tests.inspection.cases import case, dump
from tests.recordings.conftest import write_small
from tests.recordings.ros_bags import write_bag

CAMERA = Camera(640, 480, 600.0, 610.0, 319.5, 239.5)
INTRINSIC = {"width": 640, "height": 480, "intrinsic_matrix": [600, 0, 0, 0, 610, 0, 320, 240, 1]}
CAMERA_SAYS = {"image": "640 x 480 pixels, focal lengths 600.00, 610.00"}
AS_POSES = {"hicp record import": "this file as --poses"}


@case("intrinsics of a camera", CAMERA_SAYS | {"depth": "5000 units per metre", "distortion": "none"},
      needs={"hicp record import": "--open3d, its folder"})  # fmt: skip
def camera(folder):
    write_camera(folder / "registration.json", CAMERA, 5000)
    return folder / "registration.json"


@case("intrinsics of a camera", CAMERA_SAYS | {"depth": "not in the file"},
      needs={"hicp record import": "--depth-scale"})  # fmt: skip
def camera_without_scale(folder):
    return dump(folder / "camera_intrinsic.json", INTRINSIC)


@case("intrinsics of a camera", {"distortion": "some; undone"}, needs={"hicp record import": "its folder"})
def camera_distorted(folder):
    return dump(
        folder / "x",
        INTRINSIC | {"depth_scale": 1000, "distortion_model": "plumb_bob", "coeffs": [0.1, -0.05, 0, 0, 0]},
    )


@case("intrinsics of a camera", problem="column by column")
def camera_by_rows(folder):
    return dump(folder / "x.json", INTRINSIC | {"intrinsic_matrix": [600, 0, 320, 0, 610, 240, 0, 0, 1]})


AGAINST = {"errors against motion capture": "in its folder"}


@case("registration of motion capture", {"units": "at 0.000, 1.000, 0.000"}, needs=AGAINST)
def registration(folder):
    T = np.eye(4)
    T[1, 3] = 1
    return dump(folder / "camera.json", {"T_base_mocap": T.tolist()})


@case("registration of motion capture", problem="not a rotation")
def registration_with_scale(folder):
    return dump(folder / "x.json", {"T_base_mocap": np.diag([1000.0, 1000, 1000, 1]).tolist()})


TIMES_S = 1.6e9 + np.arange(4) / 30
POSES = np.tile(np.eye(4), (4, 1, 1))
POSES[:, 0, 3] = np.arange(4) / 10


@case("list of images and their times (TUM)", needs={"hicp record check": "folder"}, says={
      "images": "4, of which 4 are not there",
      "times": "30 per second (median), 0.1 s, from 1600000000.000 s (since 1970: 2020"})  # fmt: skip
def rgb_list(folder):
    write_file_list(folder / "groundtruth.txt", TIMES_S, [f"rgb/{k}.png" for k in range(4)])
    return folder / "groundtruth.txt"


@case(
    "list of images and their times (TUM)", notes=["look like milliseconds"], needs={"hicp record check": ""}
)
def rgb_list_in_ms(folder):
    write_file_list(folder / "rgb.txt", np.arange(4) * 33.3, [f"rgb/{k}.png" for k in range(4)])
    return folder / "rgb.txt"


TRAJECTORY = {"poses": "4, camera to", "units": "metres; moved by 0.300, 0.000, 0.000"}


@case("trajectory of a camera (TUM)", TRAJECTORY | {"times": "30 per second"}, needs=AS_POSES)
def tum_poses(folder):
    write_poses(folder / "rgb.txt", TIMES_S, POSES)
    return folder / "rgb.txt"


@case("trajectory of a camera (TUM)", needs=AS_POSES, notes=["look like milliseconds"])
def tum_poses_in_ms(folder):
    write_poses(folder / "x.txt", np.arange(4) * 33.3, POSES)
    return folder / "x.txt"


@case("trajectory of a camera (TUM)", needs=AS_POSES, notes=["are these millimetres?"])
def tum_poses_in_mm(folder):
    far = POSES.copy()
    far[:, :3, 3] = 1000 * (1 + POSES[:, :3, 3])
    write_poses(folder / "x.txt", TIMES_S, far)
    return folder / "x.txt"


@case("trajectory of a camera (TUM)", {"poses": "4,"}, needs=AS_POSES, notes=["1 lines repeat the time"])
def tum_poses_repeated(folder):
    lines = [f"{t} 0 0 0 0 0 0 1\n" for t in (1, 2, 2, 3, 4)]
    (folder / "x.txt").write_text("".join(lines))
    return folder / "x.txt"


@case("trajectory of a camera (TUM)", problem="quaternion of length 2")
def tum_poses_without_unit_length(folder):
    (folder / "x.txt").write_text("1 0 0 0 0 0 0 2\n")
    return folder / "x.txt"


@case("trajectory of a camera (Open3D's log)", TRAJECTORY | {"times": "none"}, needs=AS_POSES)
def open3d_log(folder):
    with open(folder / "rgb.txt", "w") as file:
        for k, T in enumerate(POSES):
            file.write(f"{k} {k} {k + 1}\n" + "\n".join(" ".join(map(str, row)) for row in T) + "\n")
    return folder / "rgb.txt"


@case("trajectory of a camera (KITTI)", TRAJECTORY | {"times": "none"}, needs=AS_POSES)  # fmt: skip
def kitti_poses(folder):
    np.savetxt(folder / "rgb.txt", POSES[:, :3].reshape(4, 12))
    return folder / "rgb.txt"


@case("trajectory of a camera (EuRoC)", TRAJECTORY | {"times": "20 per second"}, needs=AS_POSES)
def euroc_poses(folder):
    header = "#timestamp [ns], p_RS_R_x [m], p_RS_R_y [m], p_RS_R_z [m], q_RS_w [], q_RS_x [], q_RS_y [], "
    header += "q_RS_z []"
    lines = [f"{1403636580838555648 + k * 50_000_000},{k / 10},0,0,1,0,0,0" for k in range(4)]
    (folder / "x.csv").write_text("\n".join([header, *lines]) + "\n")
    return folder / "x.csv"


@case(
    "joint angles of the robot",
    {"poses": "4, camera to the robot's world", "times": "10 per second"},
    needs=AS_POSES,
)
def joints(folder):
    table = pd.DataFrame(0.0, range(4), ["t_s", *(f"{joint}_deg" for joint in HEAD_JOINTS)])
    table.assign(t_s=np.arange(4) / 10).to_csv(folder / "clicks.csv", index=False)
    return folder / "clicks.csv"


@case("clicks on markers", {"clicks": "3 on 2 markers in 2 frames", "units": "pixels"},
      needs={"the registration": "motion capture"})  # fmt: skip
def clicks(folder):
    (folder / "joints.csv").write_text("frame,marker,u_px,v_px\n0,a,1,2\n0,b,3.5,4\n1,a,5,6\n")
    return folder / "joints.csv"


POINTS_M = np.arange(30.0).reshape(5, 2, 3) / 10 + 0.1
MOCAP = {"markers": "2: elbow, wrist", "frames": "5; markers seen in 100.0 %",
         "units": "metres once read; extent 2.700, 2.700, 2.700",
         "times": "100 Hz stated; 100 per second"}  # fmt: skip


def capture(names=("elbow", "wrist")) -> MotionCapture:
    return MotionCapture(np.arange(5) / 100, names, POINTS_M, 100.0)


@case("motion capture, Qualisys TSV", MOCAP, needs=AGAINST, notes=["ends in .tsv"])
def qualisys(folder):
    write_tsv(folder / "a.tsv", capture())
    return (folder / "a.tsv").rename(folder / "groundtruth.txt")


@case("motion capture, Qualisys TSV", problem="FREQUENCY is 'absent'")
def qualisys_without_rate(folder):
    write_tsv(folder / "mocap.tsv", capture())
    text = (folder / "mocap.tsv").read_text()
    (folder / "mocap.tsv").write_text("\n".join(x for x in text.split("\n") if "FREQUENCY\t100" not in x))
    return folder / "mocap.tsv"


@case("motion capture, C3D", MOCAP, needs=AGAINST)
def c3d(folder):
    write_c3d(folder / "mocap.c3d", capture())
    return folder / "mocap.c3d"


@case("motion capture, C3D", MOCAP | {"markers": "2: élbow, wrist"}, needs=AGAINST, notes=["ends in .c3d"])
def c3d_in_latin_1(folder):
    write_c3d(folder / "mocap.c3d", capture(("Xlbow", "wrist")))
    content = (folder / "mocap.c3d").read_bytes().replace(b"Xlbow", "élbow".encode("latin-1"))
    (folder / "picture.png").write_bytes(content)
    return folder / "picture.png"


@case("motion capture, C3D", problem="its reader gave up")
def c3d_cut_off(folder):
    write_c3d(folder / "mocap.c3d", capture())
    content = (folder / "mocap.c3d").read_bytes()
    (folder / "mocap.c3d").write_bytes(content[:600])
    return folder / "mocap.c3d"


BAG = {"colour": "4 on /camera/color/image_raw, about 13", "depth unit": "1000 per metre",
       "messages": "on 4 topics", "poses": "none"}  # fmt: skip
OF_BAG = {"hicp record import": "--bag; --poses, unless"}


@case("bag of ROS 1", BAG, needs=OF_BAG, notes=["ends in .bag"])
def ros1_bag(folder):
    return write_bag(folder, "ros1").rename(folder / "recording.mcap")


@case("bag of ROS 2", BAG, needs=OF_BAG)
def ros2_folder(folder):
    return write_bag(folder, "mcap")


@case("bag of ROS 2 (SQLite)", BAG, needs=OF_BAG, notes=["ends in .db3"])
def ros2_sqlite(folder):
    (path,) = write_bag(folder, "sqlite3").glob("*.db3")
    return path.rename(folder / "x.bag")


@case("bag of ROS 2 (MCAP)", BAG, needs=OF_BAG)
def ros2_mcap(folder):
    (path,) = write_bag(folder, "mcap").glob("*.mcap")
    return path


@case("bag of ROS 2", needs=OF_BAG, notes=["distortion undone"])
def ros2_distorted(folder):
    return write_bag(folder, info={"frame": "color_optical", "D": [0.1, 0, 0, 0, 0]})


@case("bag of ROS 1", problem="its reader gave up")
def ros1_cut_off(folder):
    content = write_bag(folder, "ros1").read_bytes()
    (folder / "x.bag").write_bytes(content[:300])
    return folder / "x.bag"


LIFT = {"hicp lift": "--detector", "errors against motion capture": "mocap.tsv or mocap.c3d in it"}


@case("recording of an RGB-D camera", needs=LIFT, says={
      "frames": "4 of 32 x 24 pixels", "depth": "1000 units per metre", "times": "10 per second",
      "poses": "moved by 0.030,", "motion capture": "none"})  # fmt: skip
def recording(folder):
    return write_small(folder / "bag")


@case("recording of an RGB-D camera", needs=LIFT | {"errors against motion capture": ""},
      says={"motion capture": "mocap.c3d"}, notes=["lasts 0.04 s", "does not overlap"])  # fmt: skip
def recording_with_mocap(folder):
    write_c3d(write_small(folder / "r") / "mocap.c3d", capture())
    return folder / "r"


@case("recording of an RGB-D camera", problem="is not there; 1 of 4 listed are not")
def recording_without_an_image(folder):
    next(iter(sorted((write_small(folder / "r") / "rgb").iterdir()))).unlink()
    return folder / "r"


def open3d(folder: Path, name: str, content: dict) -> Path:
    for k in range(3):
        for kind in ("color", "depth"):
            (folder / kind).mkdir(exist_ok=True)
            cv2.imwrite(str(folder / kind / f"{k:05d}.png"), np.full((48, 64), 900, np.uint16))
    dump(folder / name, content)
    return folder


@case("RGB-D folder of Open3D's tools", CAMERA_SAYS | {
      "images": "3 in each", "times": "20.0 per second, as intrinsic.json says"},
      needs={"hicp record import": "--open3d --poses"})  # fmt: skip
def open3d_folder(folder):
    return open3d(folder, "intrinsic.json", INTRINSIC | {"fps": 20.0, "depth_scale": 1000})


@case("RGB-D folder of Open3D's tools", {"times": "not known"},
      needs={"hicp record import": "--open3d --rate --depth-scale --poses"})  # fmt: skip
def open3d_python_folder(folder):
    return open3d(folder, "camera_intrinsic.json", INTRINSIC)


@case("RGB-D folder of Open3D's tools", problem="3 and 2 images; expected as many")
def open3d_folder_of_unequal_numbers(folder):
    open3d(folder, "intrinsic.json", INTRINSIC)
    (folder / "depth/00001.png").unlink()
    return folder
