"""Small trials of components that use native libraries: each detector, the renderer, the controller.

`python -m hicp_lib.cli.probes NAME` runs one trial and prints its result. The doctor runs each in a separate
process, since a native library may abort or hang.
"""

import json
import sys
from collections.abc import Callable
from functools import partial

import numpy as np

from hicp_lib.core.children import end_with
from hicp_lib.core.datafiles import DATA_DIR
from hicp_lib.core.errors import one_line
from hicp_lib.core.extras import MissingPartError
from hicp_lib.core.images import read_image
from hicp_lib.detectors.registry import DETECTORS, default_detector_names, make_detector


def probes() -> dict[str, Callable[[], str]]:
    """Trials by name; each returns its finding, or raises. Detectors of one module share a process."""
    by_module: dict[str, list[str]] = {}
    for name in default_detector_names():
        by_module.setdefault(DETECTORS[name].module, []).append(name)
    detectors = {", ".join(names): partial(_detect, names) for names in by_module.values()}
    return {**detectors, "renderer": _render, "controller": _control}


def _detect(names: list[str]) -> str:
    photograph = read_image(DATA_DIR / "photograph.jpg")
    found = [len(make_detector(name).detect(photograph)) for name in names]
    return f"in a photograph of one person: {', '.join(map(str, found))}"


def _render() -> str:
    from hicp_lib.simulation.world.scenes import render_scene

    image, people = render_scene(seed=0, index=0)
    return f"{image.shape[1]} x {image.shape[0]} pixels with {len(people)} people"


def _control() -> str:
    from hicp_lib.robot.controller import Controller
    from hicp_lib.robot.home import HOME_M, home_posture
    from hicp_lib.robot.kinematics import load_icub

    icub = load_icub()
    home = home_posture(icub)
    controller = Controller(icub, np.array(HOME_M["left"]), home.angles("left"))
    return f"{len(controller.velocities(home, []))} joint velocities"


def main(name: str) -> None:
    """Run one trial; prints in JSON whether it worked, null without its part, and a line on it."""
    end_with(0)
    is_ok: bool | None = True
    try:
        finding = probes()[name]()
    except MissingPartError as error:
        is_ok, finding = None, str(error)
    except Exception as error:  # a broken library may raise anything
        is_ok, finding = False, one_line(error)
    print(json.dumps([is_ok, finding]))


if __name__ == "__main__":
    main(sys.argv[1])
