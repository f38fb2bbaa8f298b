"""What checking files, OKS and bootstrapping cost beside the obvious ways to have them.

Three comparisons, each against a baseline of the same run: reading annotations, checked and as
arrays, against `json.load` alone; OKS of all pairs against pycocotools' loop; a bootstrap from matches
against pycocotools evaluating each draw anew (timed on a few draws).
"""

from __future__ import annotations

import contextlib
import io
import json
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
from pycocotools.coco import COCO
from pycocotools.cocoeval import COCOeval
from timing import Comparison, best_seconds, run

from hicp_lib.core.detections import Detections
from hicp_lib.core.keypoints import COCO_17, SIGMAS
from hicp_lib.core.oks import oks
from hicp_lib.evaluation.ap import cocoeval
from hicp_lib.evaluation.ap.bootstrap import N_RESAMPLES, bootstrap_intervals
from hicp_lib.evaluation.ap.evaluate import evaluate
from hicp_lib.formats.annotations import Annotations, ImageInfo, read_annotations, write_annotations

N_FOUND = 3  # detections per image


def make_people(n: int) -> tuple[Annotations, dict[int, Detections]]:
    """One annotated person per image; detections near them and elsewhere."""
    rng = np.random.default_rng(0)
    points = rng.uniform(50, 400, (n, 1, 2)) + rng.normal(0, 60, (n, 136, 2))
    boxes = np.concatenate([points.min(axis=1), np.ptp(points, axis=1)], axis=1)
    people = Annotations(
        {i: ImageInfo(i, f"{i}.png", 640, 480) for i in range(n)}, np.arange(1, n + 1), np.arange(n), boxes,
        rng.uniform(5_000, 60_000, n), np.zeros(n, dtype=bool), points, np.full((n, 136), 2.0), [{}] * n,
    )  # fmt: skip
    spread = rng.choice([3, 10, 300], (n, N_FOUND, 1, 1))
    found = points[:, None] + rng.normal(0, 1, (n, N_FOUND, 136, 2)) * spread
    scores = rng.random((n, N_FOUND))
    return people, {i: Detections(found[i], np.ones((N_FOUND, 136)), scores[i]) for i in range(n)}


def reading(people: Annotations) -> Comparison:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "annotations.json"
        write_annotations(path, people)
        ours, base = best_seconds(lambda: read_annotations(path), lambda: json.loads(path.read_bytes()))
    return Comparison("read annotations", ours, "`json.loads` of the file", base)


def similarity(people: Annotations, found: dict[int, Detections]) -> Comparison:
    sigmas = SIGMAS["halpe"][COCO_17]
    truth, labelled = people.keypoints_px[:, None, COCO_17], people.visibility[:, None, COCO_17] > 0
    points = np.stack([found[i].keypoints_px[:, COCO_17] for i in people.images])
    ours, base = best_seconds(
        lambda: oks(truth, labelled, people.boxes_px[:, None], people.areas_px2[:, None], points, sigmas),
        _pycocotools_oks(people, found, sigmas),
    )
    return Comparison("OKS of all pairs", ours, "`COCOeval.computeOks` of each image", base)


def _pycocotools_oks(
    people: Annotations, found: dict[int, Detections], sigmas: np.ndarray
) -> Callable[[], object]:
    rows = (people.keypoints_px[:, COCO_17], people.visibility[:, COCO_17], people.boxes_px, people.areas_px2)
    truth = [cocoeval.truth_row(i, *row, False) for i, *row in zip(people.images, *rows, strict=True)]
    results = [cocoeval.found_row(i, person[COCO_17], 1.0) for i in found for person in found[i].keypoints_px]
    indexed = []
    for rows in (truth, results):
        coco = COCO()
        coco.dataset = {"images": [{"id": i} for i in people.images], "categories": [{"id": 1}]}
        coco.dataset["annotations"] = [row | {"id": i + 1, "category_id": 1} for i, row in enumerate(rows)]
        with contextlib.redirect_stdout(io.StringIO()):
            coco.createIndex()
        indexed.append(coco)
    run = COCOeval(*indexed, "keypoints")
    run.params.kpt_oks_sigmas = sigmas
    run._prepare()
    return lambda: [run.computeOks(i, 1) for i in people.images]


def bootstrapping(people: Annotations, found: dict[int, Detections], n_draws: int) -> Comparison:
    evaluation = evaluate(people, found)
    (ours,) = best_seconds(lambda: bootstrap_intervals(evaluation, N_RESAMPLES), turns=1)
    # A draw costs pycocotools what the whole set costs.
    (draw,) = best_seconds(lambda: evaluate(people, found), turns=n_draws)
    return Comparison(
        f"{N_RESAMPLES} bootstrap draws from matches", ours, "pycocotools anew for each", draw * N_RESAMPLES
    )


def measure(options) -> Iterator[Comparison]:
    people, found = make_people(options.images)
    yield reading(people)
    yield similarity(people, found)
    yield bootstrapping(people, found, options.draws)


if __name__ == "__main__":
    run(measure, __doc__, images=(500, 4), draws=(3, 1))
