"""A detector, registered as "slow", that takes its time and writes down what it sees, and where.

Imported by processes that the tests start. It finds one person, at the image's first value. An image whose
first value is 255 ends the process.
"""

import os
import signal
import time
from pathlib import Path

import numpy as np

from hicp_lib.detectors.base import Detections
from hicp_lib.detectors.registry import DETECTORS, Entry


class Slow:
    name = "slow"

    def __init__(self, delay_s: float = 0.05) -> None:
        self.settings = {"version": os.environ.get("SLOW_VERSION", "1")}
        self._delay_s = delay_s

    def detect(self, image: np.ndarray) -> Detections:
        value = int(image[0, 0, 0])
        if value == 255:
            os.kill(os.getpid(), signal.SIGKILL)
        time.sleep(self._delay_s)
        keypoints_px = np.full((1, 136, 2), np.nan)
        keypoints_px[0, 0] = value, np.pi * value
        with open(Path(os.environ["SLOW_CALLS"]) / str(os.getpid()), "a") as calls:
            calls.write(f"{value}\n")
        return Detections(
            keypoints_px, np.where(np.isfinite(keypoints_px[..., 0]), 0.5, 0.0), np.array([0.7])
        )


ENTRY = DETECTORS["slow"] = Entry("slow", "Slow", "a person", ("body",), __name__, "Slow")
