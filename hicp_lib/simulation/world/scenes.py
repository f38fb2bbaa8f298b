"""Data sets of rendered people: whole images with annotations in Halpe's layout.

Images are JPEG at high quality, as the photographs of COCO and Halpe are; a PNG of a noisy
image would be five times as large and tell no more. Image k depends on the seed and k only, so
the number of worker processes changes nothing, and a larger data set contains the smaller one.
"""

from __future__ import annotations

import multiprocessing
import multiprocessing.pool
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import cv2
import numpy as np
from tqdm import tqdm

from hicp_lib.core.cache import key
from hicp_lib.core.environment import with_variables
from hicp_lib.core.errors import InputError
from hicp_lib.core.files import read_json, write_bytes, write_json
from hicp_lib.core.keypoints import N_KEYPOINTS
from hicp_lib.formats.annotations import Annotations, ImageInfo, write_annotations
from hicp_lib.simulation.rendering.colour_sensor import expose
from hicp_lib.simulation.rendering.render import Frame, render
from hicp_lib.simulation.world.staging import Stage, distance_m, random_stage
from hicp_lib.simulation.world.visibility import keypoint_visibility

JPEG_QUALITY = 95
MAX_SCENES = 1_000_000


def render_dataset(
    out: str | Path, n: int, seed: int, workers: int | None = None, progress: bool = True
) -> Annotations:
    """Render `n` images with 1 to 3 people each into a dataset folder.

    `out` gets `images/` and, last of all, `annotations.json`. Finished images of an interrupted
    run are kept and not rendered again; what another seed or another version of the renderer
    made is replaced. `area` is the visible segment's, `bbox` its bounds; visibility is 2
    visible, 1 occluded, 0 outside the image (see `visibility.keypoint_visibility`). Each
    person's true distance is kept as `distance_m`.

    Parameters
    ----------
    seed : non-negative
    workers : processes; as many as there are processors when left out

    Raises
    ------
    InputError
        For numbers out of range, or a folder that holds something else.
    """
    out = Path(out)
    _check(out, n, seed, workers)
    stamp = {"renderer": key([render_dataset]), "seed": int(seed)}
    _prepare(out, stamp)
    todo = [(str(out), seed, index) for index in range(n) if not _is_done(out, index)]
    bar = tqdm(
        total=n, initial=n - len(todo), desc="rendering", unit="image", disable=None if progress else True
    )
    for _ in _in_processes(todo, workers or os.cpu_count() or 1):
        bar.update()
    bar.close()
    annotations = _collect(out, n)
    for path in (out / "images").glob("*.jpg"):
        if int(path.stem) not in annotations.images:
            path.unlink()
    write_annotations(out / "annotations.json", annotations)
    return annotations


def _check(out: Path, n: int, seed: int, workers: int | None) -> None:
    for name, value, low in (
        ("n", n, 1),
        ("seed", seed, 0),
        ("workers", 1 if workers is None else workers, 1),
    ):
        if not isinstance(value, int | np.integer) or not low <= value <= MAX_SCENES * 1000:
            raise InputError(f"{name} is {value!r}; expected a whole number of at least {low}")
    if n > MAX_SCENES:
        raise InputError(f"n is {n}; expected at most {MAX_SCENES} images")
    if out.exists() and not out.is_dir():
        raise InputError(f"{out}: is a file; give a folder to render into")
    if out.is_dir() and any(out.iterdir()) and not (out / ".scenes").is_dir():
        raise InputError(f"{out}: holds files that were not rendered; give an empty or new folder")


def _prepare(out: Path, stamp: dict) -> None:
    """Make the folders; drop what another seed or renderer left."""
    stamp_file = out / ".scenes" / "stamp.json"
    (out / ".scenes").mkdir(parents=True, exist_ok=True)
    (out / "images").mkdir(exist_ok=True)
    (out / "annotations.json").unlink(missing_ok=True)
    if stamp_file.exists() and read_json(stamp_file) == stamp:
        return
    for path in [stamp_file, *(out / ".scenes").glob("*.json"), *(out / "images").glob("*.jpg")]:
        path.unlink(missing_ok=True)
    write_json(stamp_file, stamp)


def _image_path(out: Path, index: int) -> Path:
    return out / "images" / f"{index:06d}.jpg"


def _people_path(out: Path, index: int) -> Path:
    return out / ".scenes" / f"{index:06d}.json"


def _is_done(out: Path, index: int) -> bool:
    # The people are written after the image.
    return _people_path(out, index).exists() and _image_path(out, index).exists()


def _in_processes(todo: list[tuple[str, int, int]], workers: int) -> Iterator[None]:
    if workers == 1 or len(todo) < 3:
        yield from map(_render_one, todo)
        return
    with worker_pool(min(workers, len(todo))) as pool:
        yield from pool.imap_unordered(_render_one, todo, chunksize=2)


@contextmanager
def worker_pool(workers: int) -> Iterator[multiprocessing.pool.Pool]:
    """Processes that render, with one thread each: more threads than processors only wait for each other.

    Each starts as a fresh interpreter, since Open3D's threads do not survive a fork; the
    linear algebra library reads its number of threads when it is loaded.
    """
    names = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS")
    context = multiprocessing.get_context("spawn")
    with with_variables(**dict.fromkeys(names, "1")):
        pool = context.Pool(workers, initializer=cv2.setNumThreads, initargs=(1,))
    with pool:
        yield pool


def _render_one(job: tuple[str, int, int]) -> None:
    out, seed, index = Path(job[0]), job[1], job[2]
    image, people = render_scene(seed, index)
    bgr = cv2.cvtColor(image, cv2.COLOR_RGB2BGR)
    _, encoded = cv2.imencode(".jpg", bgr, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
    write_bytes(_image_path(out, index), encoded.tobytes())
    write_json(
        _people_path(out, index), {"width": image.shape[1], "height": image.shape[0], "people": people}
    )


def render_scene(seed: int, index: int) -> tuple[np.ndarray, list[dict]]:
    """Image `index` of a seed: RGB uint8, (height, width, 3), and its people as JSON-able rows."""
    rng = np.random.default_rng(np.random.SeedSequence([seed, index]))
    while True:
        stage = random_stage(rng)
        frame = render(stage.world, stage.camera, rng)
        people = annotate(stage, frame)
        if people:  # somebody is in the picture
            return expose(frame.radiance, stage.sensor, rng, frame.person >= 0), people


def annotate(stage: Stage, frame: Frame) -> list[dict]:
    """Box, area, keypoints and distance of everyone seen in a frame."""
    rows = []
    for number, person in enumerate(stage.people):
        v, u = np.nonzero(frame.person == number)
        if len(u) == 0:
            continue
        pixels, seen = keypoint_visibility(frame.rays, stage.camera, person.keypoints_m, number)
        box = [int(u.min()), int(v.min()), int(np.ptp(u)) + 1, int(np.ptp(v)) + 1]
        keypoints = np.where(seen[:, None] > 0, np.column_stack([pixels, seen]), 0)
        keypoints = np.clip(keypoints.round(2), 0, [frame.person.shape[1] - 1, frame.person.shape[0] - 1, 2])
        rows.append(
            {
                "bbox": box,
                "area": len(u),
                "keypoints": keypoints.tolist(),
                "distance_m": round(distance_m(stage.camera, person), 3),
            }
        )
    return rows


def _collect(out: Path, n: int) -> Annotations:
    scenes = [read_json(_people_path(out, index)) for index in range(n)]
    images = {
        k: ImageInfo(k, _image_path(out, k).name, scene["width"], scene["height"])
        for k, scene in enumerate(scenes)
    }
    people = [(k, person) for k, scene in enumerate(scenes) for person in scene["people"]]
    keypoints = np.array([p["keypoints"] for _, p in people]).reshape(-1, N_KEYPOINTS, 3)
    labelled = keypoints[..., 2:] > 0
    return Annotations(
        images=images,
        ids=np.arange(1, len(people) + 1),
        image_ids=np.array([k for k, _ in people]),
        boxes_px=np.array([p["bbox"] for _, p in people], float),
        areas_px2=np.array([p["area"] for _, p in people], float),
        is_crowd=np.zeros(len(people), bool),
        keypoints_px=np.where(labelled, keypoints[..., :2], np.nan),
        visibility=keypoints[..., 2],
        extras=[{"distance_m": p["distance_m"]} for _, p in people],
    )
