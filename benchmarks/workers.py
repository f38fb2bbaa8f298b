"""What the second core brings: threads against one process, and against as many processes as threads.

The same images through `detect_images` with an empty cache: on one thread, on as many threads as there
are cores, and by as many processes of one thread, each with its share of the images. All start when they
have imported what they need; the ways are taken in turn and the best of the repeats counts. The project's
floor is 1.7 times one process on two cores. Where the machine is busy otherwise, compare threads with
processes, which suffer alike, and look at the processor time.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from detectors import NAMES, make_images
from timing import Comparison, run

from hicp_lib.core.environment import usable_cores
from hicp_lib.core.errors import InputError
from hicp_lib.detectors.registry import make_detector
from hicp_lib.detectors.weights import default as default_weights

FLOOR_SPEED_UP = 1.7  # of two cores

_PROGRAM = """
import sys, time
folder, name, workers, *paths = sys.argv[1:]
sys.path.insert(0, folder)
from timing import processor_s
from hicp_lib.detectors.runtime import run
run.make_detector(name)  # loads its libraries
print("ready", flush=True)
input()
wall, cpu = time.perf_counter(), processor_s()
run.detect_images(name, dict(enumerate(paths)), int(workers), progress=False)
print(time.perf_counter() - wall, processor_s() - cpu)
"""


def detect_times(name: str, shares: list[list[str]], threads: int, weights: Path) -> tuple[float, float]:
    """Wall and processor seconds of one process per share of the images, side by side."""
    with tempfile.TemporaryDirectory() as cache:
        (Path(cache) / "weights").symlink_to(weights)
        processes = [
            subprocess.Popen(
                [sys.executable, "-c", _PROGRAM, str(Path(__file__).parent), name, str(threads), *share],
                env=os.environ | {"HICP_CACHE": cache},
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                text=True,
            )
            for share in shares
        ]
        if any(process.stdout.readline() != "ready\n" for process in processes):
            raise RuntimeError("a process could not start its detector")
        for process in processes:
            process.stdin.write("\n")
            process.stdin.flush()
        times = np.array([process.communicate()[0].split() for process in processes], float)
    return times[:, 0].max(), times[:, 1].sum()


def compare(name: str, paths: list[str], n: int, repeats: int) -> Iterator[Comparison]:
    """The three ways of one detector: (wall, processor) seconds, the best of the repeats."""
    make_detector(name)  # tells what is absent
    ways = (([paths], 1), ([paths], n), ([paths[i::n] for i in range(n)], 1))
    runs_s = [
        [detect_times(name, *way, default_weights.weights_dir()) for way in ways] for _ in range(repeats)
    ]
    one_s, threads_s, processes_s = np.min(runs_s, axis=0).tolist()
    most = 1 / FLOOR_SPEED_UP if n == 2 else None
    for clock, (one, threads, processes) in zip(
        ("wall", "processor"), zip(one_s, threads_s, processes_s, strict=True), strict=True
    ):
        floor = most if clock == "wall" else None
        yield Comparison(f"{name}, {n} threads, {clock} time", threads, "1 thread", one, floor)
        yield Comparison(f"{name}, {n} threads, {clock} time", threads, f"{n} processes", processes)


def measure(options) -> Iterator[Comparison]:
    n = usable_cores()
    if n == 1:
        raise InputError("this process may use one core only; two are needed to compare")
    with tempfile.TemporaryDirectory() as folder:
        paths = [str(path) for path in make_images(Path(folder), max(options.images, n)).values()]
        for name in NAMES[: options.detectors]:
            yield from compare(name, paths, n, options.repeats)


if __name__ == "__main__":
    run(measure, __doc__, images=(60, 2), repeats=(3, 1), detectors=(3, 1))
