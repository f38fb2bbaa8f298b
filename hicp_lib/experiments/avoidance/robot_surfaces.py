"""The robot as a surface to render: its own camera sees its arms, and others see all of it."""

import numpy as np

from hicp_lib.core.camera import transform
from hicp_lib.experiments.laboratory import T_WORLD_ROOT
from hicp_lib.robot.kinematics import ICub
from hicp_lib.robot.posture import Posture
from hicp_lib.robot.shape import robot_shape
from hicp_lib.simulation.rendering.mesh import Mesh, vertex_normals
from hicp_lib.simulation.rendering.surfaces import Hits, Look, Surface

_GLOSS, _ROUGHNESS = 0.04, 0.35  # of painted covers


def robot_surfaces(icub: ICub, posture: Posture, whole: bool = False) -> list[Surface]:
    """The robot in the world.

    Parameters
    ----------
    icub : ICub
    posture : Posture
    whole : bool, optional
        With what the camera on its own head does not see.

    Returns
    -------
    list of Surface
    """
    shape = robot_shape(icub, posture)
    vertices_m = transform(T_WORLD_ROOT, shape.vertices_m).astype(np.float32)
    triangles = shape.triangles if whole else shape.triangles[~shape.unseen]
    normals = vertex_normals(vertices_m, triangles)
    return [Surface(Mesh(vertices_m, triangles, normals, shape.colours), _painted)]


def _painted(hits: Hits) -> Look:
    return Look(hits.coords, gloss=_GLOSS, roughness=_ROUGHNESS)
