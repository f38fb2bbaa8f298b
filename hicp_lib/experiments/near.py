"""People of the rendered scenes from near, as the camera on a robot's head sees somebody within reach.

The first person of a scene stands or sits there alone, in the same clothes, pose, room and light. The camera
is the robot's. It stands before the person's foremost part at the height of the robot's head, and looks at
some height between hips and neck: as in the recordings of the robot, the person is cut by the image's edges.
"""

from dataclasses import replace

import numpy as np

from hicp_lib.core.keypoints import INDEX
from hicp_lib.experiments.laboratory import COLOUR
from hicp_lib.simulation.body.identities import HELD_OUT, Rng
from hicp_lib.simulation.body.model import PosedBody
from hicp_lib.simulation.rendering.camera import PlacedCamera, look_at
from hicp_lib.simulation.world.staging import Stage, random_stage

DISTANCE_M = (0.4, 1.2)
"""Along the floor, from the camera to the foremost part of the person."""
_EYE_M = (1.0, 1.1)  # above the floor
_SIDE_SD_M, _AZIMUTH_SD_RAD, _ROLL_SD_RAD = 0.08, 0.25, 0.02


def near_stage(rng: Rng, split: str = HELD_OUT) -> Stage:
    """A `random_stage` with its first person alone, and the camera near.

    Parameters
    ----------
    rng : numpy.random.Generator
    split : str, optional
        Of the identities.

    Returns
    -------
    Stage
    """
    stage = random_stage(rng, split)
    person, identity = stage.people[0], stage.identities[0]
    alone = [surface for surface in stage.world.surfaces if surface.person <= 0]
    world, camera = replace(stage.world, surfaces=alone), _camera(identity.draw("camera", "near"), person)
    return replace(stage, world=world, camera=camera, people=[person], identities=[identity])


def _camera(rng: Rng, person: PosedBody) -> PlacedCamera:
    azimuth_rad = rng.normal(0, _AZIMUTH_SD_RAD)
    towards_camera = np.array([np.sin(azimuth_rad), -np.cos(azimuth_rad), 0])
    hips_m, neck_m = person.keypoints_m[[INDEX["mid_hip"], INDEX["neck"]]].astype(float)
    target_m = np.array([*hips_m[:2], rng.uniform(hips_m[2], neck_m[2])])
    target_m[0] += rng.normal(0, _SIDE_SD_M)
    ahead_m = ((person.vertices_m - target_m) @ towards_camera).max() + rng.uniform(*DISTANCE_M)
    eye_m = target_m + ahead_m * towards_camera
    eye_m[2] = rng.uniform(*_EYE_M)
    pose = look_at(eye_m, target_m, roll_rad=rng.normal(0, _ROLL_SD_RAD))
    return PlacedCamera(**vars(COLOUR), T_world_camera=pose)
