"""What the detector pipeline costs on top of the bare model calls.

The same image files, threads and models twice: in the shortest loop that can be written (read
the image, call the model, throw the output away), and through `detect_images` with an empty
cache (hashing, conversion to Halpe, for OpenPose peaks and assembly, results written). The two
are timed in turn and the best of the repeats counts. The project's floor is a ratio of 1.10.
Processor time is given too, child processes' included: it tells more than wall time on a machine that is busy
otherwise.

Then a call of MediaPipe in its own process against the same task in this one, in turn; the floor is 1.05.
The first quartile counts: a machine that is busy otherwise takes its time to wake a process.
"""

from __future__ import annotations

import os
import shutil
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import cv2
import matplotlib
import numpy as np
from timing import Comparison, processor_s
from timing import run as run_benchmark

from hicp_lib.core.environment import usable_cores
from hicp_lib.core.images import read_image, write_png
from hicp_lib.detectors import registry
from hicp_lib.detectors.mediapipe import bundles, child
from hicp_lib.detectors.openpose import networks as openpose_net
from hicp_lib.detectors.runtime import isolation as native
from hicp_lib.detectors.runtime import run
from hicp_lib.detectors.weights import default as default_weights

SQUARE_NETS = ("movenet-thunder", "movenet-lightning", "movenet-multipose", "posenet")
NAMES = ("mediapipe-pose", "mediapipe-hands", "openpose-mobilenet", *SQUARE_NETS)
FLOOR_PIPELINE, FLOOR_PROCESS = 1.10, 1.05
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
        return lambda image: detector.maps(openpose_net.scaled(image, 368))
    if name in SQUARE_NETS:
        model, size_px = detector._model, detector._model.size_px
        return lambda image: model.run(cv2.dnn.blobFromImage(cv2.resize(image, size_px)))
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


def compare(name: str, paths: dict[int, Path], workers: int, repeats: int) -> Iterator[Comparison]:
    """The pipeline beside the bare calls, per image."""
    # Axes: repeat, (bare, pipeline), (wall, processor).
    times = [
        [stopwatch(work, name, paths, workers) for work in (run_bare, run_pipeline)] for _ in range(repeats)
    ]
    bare_s, pipeline_s = (np.min(times, axis=0) / len(paths)).tolist()
    for k, (clock, most) in enumerate((("wall", FLOOR_PIPELINE), ("processor", None))):
        what = f"{name}, threads: {workers}, {clock} time of an image"
        yield Comparison(what, pipeline_s[k], "bare model calls", bare_s[k], most)


def compare_process(name: str, size_px: tuple[int, int], calls: int) -> Comparison:
    """A call in this process and in one of its own, on the same image of (width, height), in turn."""
    photograph = read_image(Path(matplotlib.get_data_path()) / "sample_data" / "grace_hopper.jpg")
    image = cv2.resize(photograph, size_px, interpolation=cv2.INTER_AREA)
    task, n = {"mediapipe-pose": ("pose", 1), "mediapipe-hands": ("hand", 2)}[name]
    here = child.detection(bundles.assemble(task), task, n=n, min_score=0.5)
    process = registry.make_detector(name)._process
    process.start()
    own = process.ask
    if not np.array_equal(here(image), own(image)):
        raise SystemExit(f"{name}: answers differ")
    times_s = [[stopwatch(call, image)[0] for call in (here, own)] for _ in range(calls)]
    here_s, own_s = np.percentile(times_s, 25, axis=0).tolist()
    what = f"{name}, {size_px[0]} x {size_px[1]}, its own process"
    return Comparison(what, own_s, "a call in this process", here_s, FLOOR_PROCESS)


def measure(options) -> Iterator[Comparison]:
    """All detectors on one thread and on all cores."""
    weights = default_weights.weights_dir()
    # What runs in this process, here only, would send usage metrics.
    os.environ.update(native.offline_environment())
    with tempfile.TemporaryDirectory() as folder:
        os.environ["HICP_CACHE"] = folder
        (Path(folder) / "weights").symlink_to(weights)
        (Path(folder) / "images").mkdir()
        paths = make_images(Path(folder) / "images", options.images)
        for name in NAMES[: options.detectors]:
            for workers in sorted({1, min(options.workers or usable_cores(), usable_cores())}):
                yield from compare(name, paths, workers, options.repeats)
        for name, size_px in PROCESS_CASES[: options.processes]:
            yield compare_process(name, size_px, options.images)


if __name__ == "__main__":
    run_benchmark(
        measure, __doc__,
        images=(100, 1), repeats=(3, 1), detectors=(7, 1), workers=(0, 1), processes=(5, 1),
    )  # fmt: skip
    sys.stdout.flush()
    os._exit(0)  # tasks of MediaPipe are not closed well when an interpreter ends
