"""Data sets of rendered people: whole images with annotations in Halpe's layout.

People are either all development or all held-out identities (see `hicp_lib.simulation.body.identities`).
Images are JPEG at high quality, as the photographs of COCO and Halpe are; a PNG of a noisy image would be
five times as large without more information. Image k depends on the seed and k only, so the number of worker
processes does not matter, and a larger data set contains the smaller one.
"""

from collections.abc import Callable
from dataclasses import asdict
from functools import partial
from pathlib import Path

import numpy as np
from tqdm import tqdm

from hicp_lib.core.cache import key
from hicp_lib.core.executor import Workers, resolved, run_jobs
from hicp_lib.core.files import read_json
from hicp_lib.core.folders import locked_folder
from hicp_lib.core.keypoints import N_KEYPOINTS
from hicp_lib.formats.annotations import Annotations, ImageInfo, write_annotations
from hicp_lib.recordings.writer import write_rgb
from hicp_lib.simulation.body.identities import HELD_OUT, Rng, split_members, stream
from hicp_lib.simulation.rendering.camera import project_world
from hicp_lib.simulation.rendering.colour_sensor import expose
from hicp_lib.simulation.rendering.render import Frame, render
from hicp_lib.simulation.world.batch import check_numbers, keep_parts, read_part, write_part
from hicp_lib.simulation.world.staging import Stage, random_stage
from hicp_lib.simulation.world.visibility import keypoint_visibility

MAX_SCENES = 1_000_000
_MAX_NUMBER = 1_000_000_000  # of seeds
Staged = Callable[[Rng, str], Stage]
_PARTS_DIR = ".scenes"  # the people of finished images, and their settings


def render_dataset(
    out: str | Path,
    n: int,
    seed: int,
    workers: Workers = None,
    progress: bool = True,
    split: str = HELD_OUT,
    staged: Staged = random_stage,
) -> Annotations:
    """Render `n` images with 1 to 3 people each into a dataset folder.

    `out` gets `images/` and, last of all, `annotations.json`. Finished images of an interrupted
    run are kept and not rendered again; images of another seed or renderer version are replaced. `area` is
    the visible segment's, `bbox` its bounds; visibility is 2 visible, 1 occluded, 0 outside the image (see
    `visibility.keypoint_visibility`). Each person's true distance is stored as `distance_m`, and the identity
    as `identity`.

    Parameters
    ----------
    out : str or Path
    n : int
        How many images.
    seed : int
        Non-negative.
    workers : int or str, optional
        Processes, or the address of a Dask scheduler (`hicp_lib.core.executor.resolved`).
    progress : bool, optional
        Whether to show a bar on a terminal.
    split : str, optional
        Whose people: "development" or "held out".
    staged : callable, optional
        The scene to photograph, from a generator and the split; a function of a module.

    Returns
    -------
    Annotations

    Raises
    ------
    InputError
        For an unknown split, numbers out of range, or a folder that holds something else or is being filled.
    """
    out, workers = Path(out), resolved(workers)
    check_numbers(n=(n, 1, MAX_SCENES), seed=(seed, 0, _MAX_NUMBER))
    split_members(split)  # an unknown name fails before anything is written
    with locked_folder(out):
        stamp = {"renderer": key([render_dataset, staged]), "seed": int(seed), "people": split}
        keep_parts(out, _PARTS_DIR, "annotations.json", stamp, int(n), partial(_files, out), [])
        missing = [k for k in range(n) if read_part(*_files(out, k)) is None]
        one = partial(_render_one, seed=seed, split=split, staged=staged)
        jobs = [(str(_files(Path(), k)[0]), partial(one, index=k)) for k in missing]
        done, shown = run_jobs(jobs, workers, folder=out), {"unit": "image", "disable": not progress or None}
        for _ in tqdm(done, "rendering", n, initial=n - len(missing), **shown):
            pass
        annotations = _collect(out, n)
        write_annotations(out / "annotations.json", annotations)
    return annotations


def _files(out: Path, index: int) -> list[Path]:
    """What is known of an image, and the image."""
    return [out / _PARTS_DIR / f"{index:06d}.json", out / "images" / f"{index:06d}.jpg"]


def _render_one(out: Path, seed: int, index: int, split: str, staged: Staged) -> None:
    image, people = render_scene(seed, index, split, staged)
    write_rgb(_files(out, index)[1], image)
    height, width = image.shape[:2]
    write_part({"width": width, "height": height, "people": people}, *_files(out, index))


def render_scene(
    seed: int, index: int, split: str = HELD_OUT, staged: Staged = random_stage
) -> tuple[np.ndarray, list[dict]]:
    """One image of a data set.

    Parameters
    ----------
    seed, index : int
    split : str, optional
        Whose people: "development" or "held out".
    staged : callable, optional
        As of `render_dataset`.

    Returns
    -------
    image : array, shape (height, width, 3), dtype uint8
        RGB.
    people : list of dict
        As `annotate` describes them.
    """
    rng = stream(split, seed, index)
    while True:
        stage = staged(rng, split)
        frame = render(stage.world, stage.camera)
        people = annotate(stage, frame)
        if people:  # someone is visible
            return expose(frame.radiance, stage.sensor, rng, frame.person >= 0), people


def annotate(stage: Stage, frame: Frame) -> list[dict]:
    """All people visible in a frame, as JSON-able dictionaries.

    Returns
    -------
    list of dict
        Of each person `bbox` (x, y, width, height) and `area` of the visible pixels, `keypoints`
        (136 times u, v, visibility; zeros outside the image), `distance_m`, and `identity`.
    """
    rows = []
    for number, (person, identity) in enumerate(zip(stage.people, stage.identities, strict=True)):
        own = frame.person == number
        if not own.any():
            continue
        (left, right), (top, bottom) = (
            np.flatnonzero(own.any(axis=axis))[[0, -1]].tolist() for axis in (0, 1)
        )
        pixels, seen = keypoint_visibility(frame.rays, stage.camera, person.keypoints_m, number)
        box = [left, top, right - left + 1, bottom - top + 1]
        keypoints = np.where(seen[:, None] > 0, np.column_stack([pixels, seen]), 0)
        last = [stage.camera.width_px - 1, stage.camera.height_px - 1, 2]
        keypoints = np.clip(keypoints.round(2), 0, last).tolist()
        # The middle of the keypoints, along the camera's z axis.
        away_m = round(float(np.median(project_world(stage.camera, person.keypoints_m)[1])), 3)
        about = {"distance_m": away_m, "identity": asdict(identity)}
        rows.append({"bbox": box, "area": int(own.sum()), "keypoints": keypoints} | about)
    return rows


def _collect(out: Path, n: int) -> Annotations:
    scenes = [read_json(_files(out, index)[0]) for index in range(n)]
    images = {
        k: ImageInfo(k, _files(out, k)[1].name, scene["width"], scene["height"])
        for k, scene in enumerate(scenes)
    }
    people = [person for scene in scenes for person in scene["people"]]
    keypoints = np.array([person["keypoints"] for person in people]).reshape(-1, N_KEYPOINTS, 3)
    labelled = keypoints[..., 2:] > 0
    return Annotations(
        images=images,
        ids=np.arange(1, len(people) + 1),
        image_ids=np.repeat(np.arange(n), [len(scene["people"]) for scene in scenes]),
        boxes_px=np.array([person["bbox"] for person in people], float),
        areas_px2=np.array([person["area"] for person in people], float),
        is_crowd=np.zeros(len(people), bool),
        keypoints_px=np.where(labelled, keypoints[..., :2], np.nan),
        visibility=keypoints[..., 2],
        extras=[{name: person[name] for name in ("distance_m", "identity")} for person in people],
    )
