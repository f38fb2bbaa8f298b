"""Small trials of components that use native libraries: each detector, the renderer, the controller.

`python -m hicp_lib.cli.probes NAME` runs one trial and prints its result. The doctor runs each in a separate
process, since a native library may abort or hang.
"""

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

EXIT_FAILED, EXIT_ABSENT = 1, 3
"""Exit codes if the trial failed, and if an optional part is not installed."""


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


def main(name: str) -> int:
    """Run one trial; prints its result in one line."""
    end_with(0)
    try:
        print(probes()[name]())
    except MissingPartError as error:
        print(error)
        return EXIT_ABSENT
    except Exception as error:  # a broken library may raise anything
        print(one_line(error))
        return EXIT_FAILED
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
