"""What the detector pipeline costs on top of the bare model calls.

    python benchmarks/detectors.py [--images 100] [--repeats 3] [--json OUT]

The same image files, threads and models twice: in the shortest loop that can be written (read
the image, call the model, throw the output away), and through `detect_images` with an empty
cache (hashing, conversion to Halpe, for OpenPose peaks and assembly, results written). The two
are timed in turn and the best of the repeats counts. The project's floor is a ratio of 1.10.
Processor time is given too, child processes' included: it tells more than wall time on a machine that is busy
otherwise.

Then a call of MediaPipe in its own process against the same task in this one, in turn; the floor is 1.05.
The first quartile counts: a machine that is busy otherwise takes its time to wake a process. Last
MobileNet-thin's network alone, on one thread, against OpenCV running the same file.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import sys
import tempfile
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import cv2
import matplotlib
import numpy as np
import psutil

from hicp_lib.core.images import read_image, write_png
from hicp_lib.detectors import registry
from hicp_lib.detectors.mediapipe import bundles, child
from hicp_lib.detectors.openpose import mobilenet as openpose_net
from hicp_lib.detectors.runtime import isolation as native
from hicp_lib.detectors.runtime import run
from hicp_lib.detectors.weights import default as zoo

NAMES = ("mediapipe-pose", "mediapipe-hands", "openpose-mobilenet")
PROCESS_CASES = [
    *(("mediapipe-pose", size_px) for size_px in ((640, 480), (256, 256))),
    *(("mediapipe-hands", size_px) for size_px in ((640, 480), (256, 256), (100, 100))),
]


def make_images(folder: Path, n: int) -> dict[int, Path]:
    """Crops of matplotlib's sample photograph, of the sizes HiCP crops have, as PNG."""
    photograph = read_image(Path(matplotlib.get_data_path()) / "sample_data" / "grace_hopper.jpg")
    rng = np.random.default_rng(0)
    paths = {}
    for i in range(n):
        left, top = rng.integers(0, 60, 2)
        crop = photograph[top : top + rng.integers(420, 540), left : left + rng.integers(400, 450)]
        paths[i] = folder / f"{i}.png"
        write_png(paths[i], cv2.resize(crop, None, fx=0.7, fy=0.7, interpolation=cv2.INTER_AREA))
    return paths


def bare_call(name: str) -> Callable[[np.ndarray], object]:
    """The model without what this package makes of its output: a function of an RGB image."""
    detector = registry.make_detector(name)
    if isinstance(detector, openpose_net.OpenPoseMobileNet):
        return lambda image: detector.maps(openpose_net.fit(image, 368))
    return detector._process.ask


def run_bare(name: str, paths: dict[int, Path], workers: int) -> None:
    """Make the models and show them every image."""
    models = [bare_call(name) for _ in range(workers)]

    def call(path: Path) -> None:
        model = models.pop()
        model(read_image(path))
        models.append(model)

    cv2.setNumThreads(1)
    with ThreadPoolExecutor(workers) as executor:
        list(executor.map(call, paths.values()))


def run_pipeline(name: str, paths: dict[int, Path], workers: int) -> None:
    """`detect_images` with nothing in its cache."""
    shutil.rmtree(Path(os.environ["HICP_CACHE"]) / "detections", ignore_errors=True)
    run.detect_images(name, paths, workers=workers, progress=False)


def stopwatch(work: Callable, *arguments: object) -> tuple[float, float]:
    """Wall and processor seconds of a call."""
    wall, cpu = time.perf_counter(), processor_s()
    work(*arguments)
    return time.perf_counter() - wall, processor_s() - cpu


def processor_s() -> float:
    """Processor time of this process and of its children, running or ended."""
    running = [other.cpu_times() for other in psutil.Process().children()]
    return sum(os.times()[:4]) + sum(times.user + times.system for times in running)


def measure(name: str, paths: dict[int, Path], workers: int, repeats: int) -> dict:
    """Best times of both and their ratio."""
    # Axes: repeat, (bare, pipeline), (wall, processor).
    times = [
        [stopwatch(work, name, paths, workers) for work in (run_bare, run_pipeline)] for _ in range(repeats)
    ]
    (bare_s, bare_cpu_s), (pipeline_s, pipeline_cpu_s) = np.min(times, axis=0)
    n = len(paths)
    return {
        "detector": name,
        "workers": workers,
        "images": n,
        "bare_ms_per_image": 1e3 * bare_s / n,
        "pipeline_ms_per_image": 1e3 * pipeline_s / n,
        "ratio": pipeline_s / bare_s,
        "cpu_ratio": pipeline_cpu_s / bare_cpu_s,
    }


def measure_process(name: str, size_px: tuple[int, int], calls: int) -> dict:
    """A call in this process and in one of its own, on the same image of (width, height), in turn."""
    photograph = read_image(Path(matplotlib.get_data_path()) / "sample_data" / "grace_hopper.jpg")
    image = cv2.resize(photograph, size_px, interpolation=cv2.INTER_AREA)
    task, n = {"mediapipe-pose": ("pose", 1), "mediapipe-hands": ("hand", 2)}[name]
    here = child.detection(bundles.assemble(task), task, n=n, min_score=0.5)
    process = registry.make_detector(name)._process
    start_s, start_cpu_s = stopwatch(process.start)
    own = process.ask
    if not np.array_equal(here(image), own(image)):
        raise SystemExit(f"{name}: answers differ")
    times_s = [[stopwatch(call, image)[0] for call in (here, own)] for _ in range(calls)]
    here_s, own_s = np.percentile(times_s, 25, axis=0).tolist()
    return {
        "detector": name,
        "image": size_px,
        "here_ms": 1e3 * here_s,
        "own_process_ms": 1e3 * own_s,
        "ratio": own_s / here_s,
        "start_s": start_s,
        "start_cpu_s": start_cpu_s,
    }


def measure_network(paths: dict[int, Path], repeats: int) -> dict:
    """Best processor times of MobileNet-thin's network, run by OpenCV and here, and their ratio."""
    detector = registry.make_detector("openpose-mobilenet")
    network = cv2.dnn.readNetFromTensorflow(np.frombuffer(zoo.load(openpose_net.WEIGHTS), np.uint8))
    inputs = [openpose_net.fit(read_image(path), 368) for path in paths.values()]

    def run_opencv() -> None:
        for net_input in inputs:
            network.setInput(cv2.dnn.blobFromImage(net_input.pixels, swapRB=True))
            network.forward()

    def run_here() -> None:
        for net_input in inputs:
            detector.maps(net_input)

    cv2.setNumThreads(1)
    times = [[stopwatch(work)[1] for work in (run_opencv, run_here)] for _ in range(repeats)]
    opencv_s, here_s = np.min(times, axis=0).tolist()
    return {
        "network": openpose_net.WEIGHTS,
        "images": len(inputs),
        "opencv_ms_per_image": 1e3 * opencv_s / len(inputs),
        "here_ms_per_image": 1e3 * here_s / len(inputs),
        "ratio": here_s / opencv_s,
    }


def main() -> None:
    """Measure all detectors on one thread and on all cores; print a table, write JSON if asked."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--images", type=int, default=100)
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--json", type=Path)
    arguments = parser.parse_args()
    # What runs in this process, here only, would send usage metrics.
    os.environ.update(native.child_environment())
    rows = []
    weights = zoo.weights_dir()
    with tempfile.TemporaryDirectory() as folder:
        os.environ["HICP_CACHE"] = folder
        shutil.copytree(weights, Path(folder) / "weights")
        (Path(folder) / "images").mkdir()
        paths = make_images(Path(folder) / "images", arguments.images)
        for name in NAMES:
            for workers in sorted({1, run.n_cores()}):
                row = measure(name, paths, workers, arguments.repeats)
                rows.append(row)
                print(
                    f"{name:20} workers {workers}: bare {row['bare_ms_per_image']:6.1f} ms, "
                    f"pipeline {row['pipeline_ms_per_image']:6.1f} ms per image, "
                    f"ratio {row['ratio']:.3f} (processor time {row['cpu_ratio']:.3f})"
                )
        for name, size_px in PROCESS_CASES:
            row = measure_process(name, size_px, arguments.images)
            rows.append(row)
            print(
                f"{name:20} {size_px}: {row['here_ms']:.2f} ms in this process, in its own "
                f"{row['own_process_ms']:.2f} ms, ratio {row['ratio']:.3f}; started in "
                f"{row['start_s']:.2f} s (processor time {row['start_cpu_s']:.2f} s)"
            )
        row = measure_network(paths, arguments.repeats)
        rows.append(row)
        print(
            f"{row['network']}: OpenCV {row['opencv_ms_per_image']:.1f} ms, here "
            f"{row['here_ms_per_image']:.1f} ms of processor time per image, ratio {row['ratio']:.3f}"
        )
    if arguments.json:
        arguments.json.write_text(json.dumps(rows, indent=2) + "\n")
    sys.stdout.flush()
    os._exit(0)  # tasks of MediaPipe are not closed well when an interpreter ends


if __name__ == "__main__":
    main()
