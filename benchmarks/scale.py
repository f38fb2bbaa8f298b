"""What many images cost: an image by each detector on one core, by workers of a cluster, and when it is kept.

`hicp detect`'s way, from image files to the file of results. With a detector that answers at once the rest is
left: reading and hashing the image, keeping and writing the result. On a Dask cluster of this machine, whose
scheduler and workers are processes of their own, the client's processor time for an image says how many
images a second one client can give away and write, whatever the number of workers; beyond the machine's
cores, workers only share them.

The page *Scale* of the book is made of `data/scale.json`: benchmarks/scale.py --json data/scale.json
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
from detectors import make_images
from timing import Comparison, processor_s, run

from hicp_lib.core.detections import Detections
from hicp_lib.core.images import write_png
from hicp_lib.detectors import registry
from hicp_lib.detectors.runtime.to_file import detect_to_file, open_pictures
from hicp_lib.detectors.weights import default as default_weights

WORKERS = (1, 2, 4, 8)


class Instant:
    """Finds one person with 17 keypoints, at once."""

    name, settings = "instant", {"version": 1}

    def detect(self, image: np.ndarray) -> Detections:
        values = np.random.default_rng(image.ravel()[:3].tolist()).random((1, 136, 3))
        values[:, 17:] = np.nan, np.nan, 0.0
        return Detections(640 * values[..., :2], values[..., 2], np.array([0.5]))


@contextmanager
def fresh_cache(weights: Path) -> Iterator[Path]:
    """A folder for results, with nothing kept in it."""
    before = os.environ.get("HICP_CACHE")
    with tempfile.TemporaryDirectory() as cache:
        (Path(cache) / "weights").symlink_to(weights)
        os.environ["HICP_CACHE"] = cache
        try:
            yield Path(cache)
        finally:
            os.environ.pop("HICP_CACHE")
            if before is not None:
                os.environ["HICP_CACHE"] = before


def detect_seconds(name: str, images: Path, out: Path, workers: int | str = 1) -> tuple[float, float, float]:
    """Wall time, processor time of this process and its children, and of this process alone; of an image."""
    start_s = time.perf_counter(), processor_s(), time.process_time()
    _, n_images, _ = detect_to_file(name, open_pictures(images), out, print, workers=workers, progress=False)
    end_s = time.perf_counter(), processor_s(), time.process_time()
    wall_s, all_s, own_s = (np.subtract(end_s, start_s) / n_images).tolist()
    return wall_s, all_s, own_s


def by_detector(
    names: list[str], images: Path, out: Path, weights: Path, instant_s: float
) -> Iterator[Comparison]:
    for name in names:
        with fresh_cache(weights):
            registry.make_detector(name)  # loads its libraries
            _, all_s, _ = detect_seconds(name, images, out)
        yield Comparison(f"an image, {name}", all_s, "a detector that answers at once", instant_s)


_CLUSTER = """
import sys
from distributed import LocalCluster
if __name__ == "__main__":
    with LocalCluster(int(sys.argv[1]), threads_per_worker=1, dashboard_address=None) as cluster:
        print(cluster.scheduler_address, flush=True)
        sys.stdin.read()
"""


@contextmanager
def cluster_beside(n: int) -> Iterator[str]:
    """The address of a cluster of `n` workers; its scheduler takes no time of this process."""
    with subprocess.Popen(
        [sys.executable, "-c", _CLUSTER, str(n)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as process:
        yield process.stdout.readline().strip()
        process.stdin.close()  # it ends


def by_workers(name: str, images: Path, out: Path, weights: Path, most: int) -> Iterator[Comparison]:
    first_s = None
    for n in (n for n in WORKERS if n <= most):
        with cluster_beside(n) as address:
            for _ in ("workers load the network", "they have it"):
                with fresh_cache(weights):
                    wall_s, _, own_s = detect_seconds(name, images, out, address)
        first_s = first_s or wall_s
        yield Comparison(f"an image, {name}, Dask workers: {n}, wall time", wall_s, "1 worker", first_s)
        yield Comparison(
            f"an image, {name}, Dask workers: {n}, the client's share", own_s, "all of it", wall_s
        )


def measure(options) -> Iterator[Comparison]:
    weights, names = default_weights.weights_dir(), registry.default_detector_names()
    registry.DETECTORS["instant"] = registry.Entry(
        "instant", "Instant", ("body",), __name__, "Instant", registry.DETECTORS["posenet"].facts
    )
    with tempfile.TemporaryDirectory() as temporary:
        folder, out = Path(temporary), Path(temporary) / "out.json"
        for i in range(options.kept):
            write_png(
                folder / "tiny" / f"{i}.png", np.full((8, 8, 3), (i >> 16, i >> 8 & 255, i & 255), np.uint8)
            )
        with fresh_cache(weights):
            _, instant_s, _ = detect_seconds("instant", folder / "tiny", out)
            _, kept_s, _ = detect_seconds("instant", folder / "tiny", out)
        yield Comparison("an image, kept", kept_s, "found at once, and kept", instant_s, most_s=1 / 5000)
        for kind, n in (("few", options.images), ("many", options.spread)):
            make_images(folder / kind, n)
        yield from by_detector(names[: options.detectors], folder / "few", out, weights, instant_s)
        yield from by_workers("movenet-lightning", folder / "many", out, weights, options.workers)


if __name__ == "__main__":
    run(
        measure,
        __doc__,
        images=(60, 2),
        spread=(400, 2),
        kept=(20_000, 4),
        detectors=(100, 1),
        workers=(8, 1),
    )
