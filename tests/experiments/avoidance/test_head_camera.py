"""What the camera on the head sees of a table whose place is known, and which pictures detectors share."""

from dataclasses import dataclass

import numpy as np
import pytest

from hicp_lib.core.detections import Detections
from hicp_lib.core.keypoints import N_KEYPOINTS
from hicp_lib.experiments.avoidance import head_camera
from hicp_lib.experiments.avoidance.closed_loop import MOUNT, start_posture
from hicp_lib.experiments.avoidance.head_camera import HeadCamera
from hicp_lib.experiments.avoidance.reaching import LOOKED_AT_S
from hicp_lib.experiments.laboratory import COLOUR, ROOT_HEIGHT_M, furnished
from hicp_lib.robot.kinematics import load_icub
from hicp_lib.simulation.appearance import materials as m
from hicp_lib.simulation.body.identities import Subject
from hicp_lib.simulation.rendering import mesh as g
from hicp_lib.simulation.rendering.surfaces import Surface

TABLE_M = -0.15  # below the robot's root


@dataclass(frozen=True)
class Table:
    """A red table before the robot instead of a person."""

    script: str = "table"
    subject: Subject = Subject()

    time_s: float = 2.0

    def world(self, robot):
        high = ROOT_HEIGHT_M + TABLE_M
        top = Surface(g.box([-1, 0.05, high - 0.02], [1, 1.2, high]), m.plain(np.array([0.6, 0.02, 0.02])))
        return furnished(Subject().identity, [top, *robot], [])


@dataclass
class Pointing:
    """A detector that finds one person, at pixels it was told."""

    pixels_px: np.ndarray

    def detect(self, rgb):
        return Detections(self.pixels_px[None], np.ones((1, len(self.pixels_px))), np.ones(1))


def seen_at_px(points_m: np.ndarray) -> np.ndarray:
    """Pixels of points of the root frame, by the pinhole equation."""
    T_camera_root = np.linalg.inv(load_icub().T_root_camera(start_posture().angles("head"), MOUNT))
    x, y, z = T_camera_root[:3, :3] @ points_m.T + T_camera_root[:3, 3:]
    return np.stack([COLOUR.fx_px * x / z + COLOUR.cx_px, COLOUR.fy_px * y / z + COLOUR.cy_px], axis=1)


def test_points_of_a_table_are_found_where_they_are_and_the_robots_hand_is_none():
    places = np.stack(np.meshgrid(np.linspace(-0.7, -0.45, 9), np.linspace(-0.1, 0.12, 15)), axis=-1)
    points_m = np.c_[places.reshape(-1, 2), np.full(135, TABLE_M)]
    posture = start_posture()
    palm_m = load_icub().chains["left"].T_root_link("hand", posture.angles("left"))[:3, 3]
    assert len(points_m) + 1 == N_KEYPOINTS
    camera = HeadCamera(Pointing(seen_at_px(np.r_[points_m, palm_m[None]])), "paper")
    found_m = camera.perceive(Table(), posture, posture).keypoints_m[0]
    assert np.isnan(found_m[-1]).all()
    assert np.isfinite(found_m[:-1]).mean() > 0.9
    assert np.nanmax(np.linalg.norm(found_m[:-1] - points_m, axis=1)) < 0.01
    (seen,) = camera.observations
    red, green, blue = seen.rgb[tuple(seen_at_px(points_m).round().astype(int).T[::-1])].astype(int).T
    assert (red > green + 50).all() and (red > blue + 50).all()


@pytest.fixture
def taken(monkeypatch):
    """Postures that pictures were taken in; no picture is rendered."""
    postures = []

    def photograph(moment, posture):
        postures.append(posture)
        return np.full((480, 640, 3), len(postures), np.uint8), np.full((480, 640), np.nan, np.float32)

    monkeypatch.setattr(head_camera, "photograph", photograph)
    return postures


def test_detectors_share_pictures_until_the_robot_gives_way(taken):
    images, pixels = {}, np.full((N_KEYPOINTS, 2), np.nan)  # nothing to lift
    first, second = (HeadCamera(Pointing(pixels), images=images) for _ in range(2))
    post = start_posture()
    trembles, away = (post.moved("left", post.angles("left") + turn) for turn in (1e-3, 0.01))
    for camera, posture in ((first, post), (second, trembles)):
        camera.perceive(Table(), posture, posture)
    assert len(taken) == 1 and np.array_equal(first.observations[0].rgb, second.observations[0].rgb)
    for other in (Table(time_s=2.1), Table(subject=Subject(1)), Table("chair")):
        second.perceive(other, post, post)
    assert len(taken) == 4
    for camera in (first, second):
        camera.perceive(Table(time_s=2.2), away, away)
    assert len(taken) == 6 and not np.array_equal(first.observations[-1].rgb, second.observations[-1].rgb)


@pytest.mark.parametrize("time_s", [LOOKED_AT_S[0] - 0.01, LOOKED_AT_S[1] + 0.01])
def test_nobody_is_found_where_no_picture_is_taken(taken, time_s):
    camera = HeadCamera(Pointing(np.full((N_KEYPOINTS, 2), np.nan)))
    assert not len(camera.perceive(Table(time_s=time_s), start_posture(), start_posture()).scores)
    assert not taken
