"""Simulated results by name, as their SHA-256: ``python made_results.py NAME ...`` prints a line for each."""

from __future__ import annotations

import sys
from collections.abc import Callable
from itertools import islice

import numpy as np

from hicp_lib.experiments.avoidance.closed_loop import Trial, simulate, start_posture, true_keypoints
from hicp_lib.experiments.avoidance.head_camera import photograph
from hicp_lib.experiments.avoidance.reaching import SCRIPTS, Moment
from hicp_lib.experiments.doses import doses
from hicp_lib.experiments.recordings.frames import record_frame
from hicp_lib.experiments.recordings.scenarios import scenario
from hicp_lib.simulation.body.identities import Subject
from hicp_lib.simulation.world.scenes import render_scene
from hicp_lib.simulation.world.staging import random_stage
from tests.simulation.contents import content


def dressed(number: int) -> str:
    """The meshes of a scene's people and room."""
    stage = random_stage(np.random.default_rng(np.random.SeedSequence([0, number])))
    return content([surface.mesh for surface in stage.world.surfaces])


def closed_loop(number: int) -> str:
    """The first steps of a run of avoidance, and what the robot's camera sees then."""
    name = list(SCRIPTS)[number % len(SCRIPTS)]
    cycles = simulate(Trial(name, 1.2, Subject(number=number)), true_keypoints)
    seen = photograph(Moment(name, Subject(number=number), 2.0), start_posture())
    return content(cycles.to_dict("list"), seen)


def captured(number: int) -> str:
    """Two seconds of motion capture."""
    capture = scenario("mocap").capture(Subject(number=number), 2.0, np.eye(4))
    return content(*capture)


KINDS: dict[str, Callable[[int], str]] = {
    "dressed": dressed,
    "scene": lambda number: content(*render_scene(0, number)),
    "mocap": lambda number: content(*record_frame("mocap", Subject(), number)),
    "upper": lambda number: content(*record_frame("relative-upper", Subject(), number)),
    "lower": lambda number: content(*record_frame("relative-lower", Subject(), number)),
    "dose": lambda number: content(*islice(doses(Subject(number=number)), 1)),
    "capture": captured,
    "avoidance": closed_loop,
}


def made(name: str) -> str:
    """SHA-256 of a result, such as "scene 3"."""
    kind, number = name.split()
    return KINDS[kind](int(number))


if __name__ == "__main__":
    for asked in sys.argv[1:]:
        print(asked, made(asked))
