"""The robot's torso and arms as surfaces to render: its own camera sees them."""

from dataclasses import replace

import numpy as np

from hicp_lib.core.camera import transform
from hicp_lib.core.memo import memoised
from hicp_lib.core.rotations import between
from hicp_lib.experiments.laboratory import T_WORLD_ROOT
from hicp_lib.robot.kinematics import ICub
from hicp_lib.robot.posture import Posture
from hicp_lib.robot.segments import Segment, body_segments
from hicp_lib.simulation.appearance import materials as m
from hicp_lib.simulation.rendering import mesh as g
from hicp_lib.simulation.rendering.surfaces import Surface

_SHELL = np.array([0.78, 0.78, 0.80])  # white covers
_HAND = np.array([0.12, 0.12, 0.13])
_N_RINGS = 6


def robot_surfaces(icub: ICub, posture: Posture) -> list[Surface]:
    """Torso, shoulders, arms and hands in the world; not the head, which carries the camera."""
    return [
        Surface(_capsule(segment), m.plain(_HAND if "hand" in segment.part else _SHELL, 0.35))
        for segment in body_segments(icub, posture)
        if segment.part not in ("head", "neck")
    ]


def _capsule(segment: Segment) -> g.Mesh:
    along = segment.end_m - segment.start_m
    length = float(np.linalg.norm(along))
    upright = _upright_capsule(round(length, 6), segment.radius_m)
    T_root_segment = np.eye(4)
    T_root_segment[:3, :3] = between(np.array([0.0, 0.0, 1.0]), along / length)
    T_root_segment[:3, 3] = segment.start_m
    T = T_WORLD_ROOT @ T_root_segment
    vertices, normals = transform(T, upright.vertices_m), upright.normals @ T[:3, :3].T
    return replace(upright, vertices_m=vertices.astype(np.float32), normals=normals.astype(np.float32))


@memoised(32)
def _upright_capsule(length_m: float, radius_m: float) -> g.Mesh:
    """Along z from the origin; the robot's limbs keep their lengths."""
    angle = np.linspace(-np.pi / 2, np.pi / 2, 2 * _N_RINGS)
    ends = np.where(angle > 0, length_m, 0.0)
    profile = np.c_[radius_m * np.cos(angle), ends + radius_m * np.sin(angle)]
    profile[[0, -1], 0] = 1e-4  # poles: triangles keep an area
    return g.lathe(profile, np.zeros(3))
