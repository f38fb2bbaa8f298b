"""A detector, registered as "slow", that takes its time and writes down what it sees, and where.

Imported by processes that the tests start. It finds one person, at the image's first value. What happens
when is settled by what has been seen, never by a clock:

- an image whose first value is 255 ends the process, one of 254 meets a fault of the detector's,
- SLOW_DIES_AFTER: the process ends at the next image once it has seen so many,
- SLOW_GATE: images from this value on wait until the tests open the gate, a file beside the calls.
"""

import os
import signal
import time
from pathlib import Path

import numpy as np

from hicp_lib.core.detections import Detections
from hicp_lib.detectors.registry import DETECTORS, Entry, Facts


class Slow:
    name = "slow"

    def __init__(self, delay_s: float = 0.01) -> None:
        self.settings = {"version": os.environ.get("SLOW_VERSION", "1")}
        self._delay_s, self._n_seen = delay_s, 0

    def detect(self, image: np.ndarray) -> Detections:
        value = int(image[0, 0, 0])
        self._n_seen += 1
        if value == 255 or self._n_seen > int(os.environ.get("SLOW_DIES_AFTER", "1000")):
            os.kill(os.getpid(), signal.SIGKILL)
        if value == 254:
            raise AttributeError("a fault of the detector's")
        folder = Path(os.environ["SLOW_CALLS"])
        while value >= int(os.environ.get("SLOW_GATE", "1000")) and not (folder.parent / "gate").exists():
            time.sleep(0.02)
        time.sleep(self._delay_s)
        keypoints_px = np.full((1, 136, 2), np.nan)
        keypoints_px[0, 0] = value, np.pi * value
        with open(folder / str(os.getpid()), "a") as calls:
            calls.write(f"{value}\n")
        return Detections(
            keypoints_px, np.where(np.isfinite(keypoints_px[..., 0]), 0.5, 0.0), np.array([0.7])
        )


ENTRY = DETECTORS["slow"] = Entry(
    "slow", "Slow", ("body",), __name__, "Slow", Facts("top-down", "one", "nothing", "none", "any")
)
