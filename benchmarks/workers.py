"""What the second core brings: threads against one process, and against as many processes as threads.

    python benchmarks/workers.py [--images 60] [--repeats 3] [--json OUT]

The same images through `detect_images` with an empty cache: on one thread, on as many threads as there
are cores, and by as many processes of one thread, each with its share of the images. All start when they
have imported what they need; the ways are taken in turn and the best of the repeats counts. The project's
floor is 1.7 times one process on two cores. Where the machine is busy otherwise, compare threads with
processes, which suffer alike, and look at the processor time.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from detectors import NAMES, make_images

from hicp_lib.detectors.runtime.run import n_cores
from hicp_lib.detectors.weights import default as zoo

_PROGRAM = """
import sys, time
from hicp_lib.detectors.runtime import run
name, workers, *paths = sys.argv[1:]
run.DetectorPool(name, {})  # loads its libraries
print("ready", flush=True)
input()
wall, cpu = time.perf_counter(), time.process_time()
run.detect_images(name, dict(enumerate(paths)), int(workers), progress=False)
print(time.perf_counter() - wall, time.process_time() - cpu)
"""


def measure(name: str, shares: list[list[str]], threads: int, weights: Path) -> tuple[float, float]:
    """Wall and processor seconds of one process per share of the images, side by side."""
    with tempfile.TemporaryDirectory() as cache:
        (Path(cache) / "weights").symlink_to(weights)
        processes = [
            subprocess.Popen(
                [sys.executable, "-c", _PROGRAM, name, str(threads), *share],
                env=os.environ | {"HICP_CACHE": cache},
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                text=True,
            )
            for share in shares
        ]
        for process in processes:
            process.stdout.readline()
        for process in processes:
            process.stdin.write("\n")
            process.stdin.flush()
        times = np.array([process.communicate()[0].split() for process in processes], float)
    return times[:, 0].max(), times[:, 1].sum()


def main() -> None:
    """Measure all detectors in the three ways; print a table, write JSON if asked."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--images", type=int, default=60)
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--json", type=Path)
    arguments = parser.parse_args()
    n, rows = n_cores(), []
    with tempfile.TemporaryDirectory() as folder:
        paths = [str(path) for path in make_images(Path(folder), arguments.images).values()]
        ways = {
            "one": ([paths], 1),
            "threads": ([paths], n),
            "processes": ([paths[i::n] for i in range(n)], 1),
        }
        for name in NAMES:
            runs = [[measure(name, *way, zoo.weights_dir()) for way in ways.values()]
                    for _ in range(arguments.repeats)]  # fmt: skip
            best = dict(zip(ways, np.min(runs, axis=0), strict=True))
            row = {"detector": name, "cores": n, "images": len(paths)}
            for way in ("threads", "processes"):
                row[f"{way}_speed_up"], row[f"{way}_cpu_ratio"] = (
                    best["one"][0] / best[way][0],
                    best[way][1] / best["one"][1],
                )
            rows.append(row)
            print(
                f"{name:20} {n} threads {row['threads_speed_up']:.2f} x one "
                f"(processor time {row['threads_cpu_ratio']:.2f}), "
                f"{n} processes {row['processes_speed_up']:.2f} x one ({row['processes_cpu_ratio']:.2f})",
                flush=True,
            )
    if arguments.json:
        arguments.json.write_text(json.dumps(rows, indent=2) + "\n")


if __name__ == "__main__":
    main()
