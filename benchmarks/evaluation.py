"""What checking files, scoring and bootstrapping cost beside the obvious ways to have them.

Each against a baseline of the same run: reading annotations, checked and as arrays, against `json.load`;
AP of all keypoints in memory, and of bodies and hands by `evaluate`, against pycocotools evaluating the
same rows; a bootstrap from matches against pycocotools evaluating each draw anew (timed on a few draws);
`hicp evaluate` on files against parsing the same files; of many people its peak of memory, too, against
the arrays of the keypoints in its files (on Linux). The project's floor of that is for `--many 200000`.
"""

from __future__ import annotations

import contextlib
import io
import json
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
from pycocotools.coco import COCO
from pycocotools.cocoeval import COCOeval
from timing import Comparison, best_seconds, processor_s, run

from hicp_lib.core.detections import Detections
from hicp_lib.core.keypoints import GROUPS, SIGMAS
from hicp_lib.core.oks import oks
from hicp_lib.evaluation.ap import cocoeval
from hicp_lib.evaluation.ap.bootstrap import bootstrap_intervals
from hicp_lib.evaluation.ap.evaluate import evaluate
from hicp_lib.evaluation.statistics.resampling import Draws
from hicp_lib.formats.annotations import Annotations, ImageInfo, read_annotations, write_annotations
from hicp_lib.formats.detections import write_detections

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


def reading(people: Annotations, most_s: float | None = None) -> Comparison:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "annotations.json"
        write_annotations(path, people)
        ours, base = best_seconds(lambda: read_annotations(path), lambda: json.loads(path.read_bytes()))
    what = f"read {len(people)} annotations"
    return Comparison(what, ours, "`json.loads` of the file", base, most_s=most_s)


def pycocotools(
    people: Annotations, found: dict[int, Detections], keypoints: np.ndarray
) -> Callable[[], object]:
    """An evaluation of plain rows, indexed beforehand; it prints, but not here."""
    truth, indexed = [], []
    for i, (points, flags) in enumerate(zip(people.keypoints_px, people.visibility, strict=True)):
        triples = np.concatenate([points, flags[:, None]], axis=1)[keypoints]
        row = {"area": people.areas_px2[i], "bbox": people.boxes_px[i].tolist(), "iscrowd": 0}
        row |= {"image_id": int(people.image_ids[i]), "num_keypoints": len(keypoints)}
        truth.append(row | {"keypoints": triples.ravel().tolist()})
    results = [
        {"image_id": i, "score": float(score), "area": 1.0,
         "keypoints": np.insert(person[keypoints], 2, 1.0, axis=1).ravel().tolist()}
        for i, of in found.items()
        for person, score in zip(of.keypoints_px, of.person_scores, strict=True)
    ]  # fmt: skip
    for rows in (truth, results):
        coco = COCO()
        coco.dataset = {"images": [{"id": i} for i in people.images], "categories": [{"id": 1}]}
        coco.dataset["annotations"] = [row | {"id": i, "category_id": 1} for i, row in enumerate(rows, 1)]
        with contextlib.redirect_stdout(io.StringIO()):
            coco.createIndex()
        indexed.append(coco)

    def anew() -> None:
        run = COCOeval(*indexed, "keypoints")
        run.params.kpt_oks_sigmas = SIGMAS["halpe"][keypoints]
        run.params.areaRng, run.params.areaRngLbl = [[0.0, np.inf]], ["all"]
        with contextlib.redirect_stdout(io.StringIO()):
            run.evaluate()
            run.accumulate()

    return anew


def in_memory(people: Annotations, found: dict[int, Detections]) -> Callable[[], object]:
    """Matching and AP of all 136 keypoints, from arrays."""
    image_ids, sigmas = np.array(list(people.images)), SIGMAS["halpe"]
    points, labelled = people.keypoints_px, people.visibility > 0
    slots = np.repeat(image_ids, [len(of) for of in found.values()])
    found_px = np.concatenate([of.keypoints_px for of in found.values()])
    detections = cocoeval.Found(slots, np.concatenate([of.person_scores for of in found.values()]))
    truth = cocoeval.People(people.image_ids, ~people.is_crowd, people.is_crowd)

    def similarity(who: np.ndarray, rows: np.ndarray) -> np.ndarray:
        rest = people.boxes_px[who], people.areas_px2[who], found_px[rows, None]
        return oks(points[who], labelled[who], *rest, sigmas)

    return lambda: cocoeval.precision_recall(cocoeval.match(image_ids, truth, detections, similarity))


def scoring(people: Annotations, found: dict[int, Detections]) -> Iterator[Comparison]:
    every = np.arange(people.keypoints_px.shape[1])
    ours, base = best_seconds(in_memory(people, found), pycocotools(people, found, every))
    yield Comparison(
        "AP of 136 keypoints, arrays", ours, "`COCOeval` of the same, in memory", base, most=30 / 374
    )
    for group, keypoints in GROUPS.items():
        ours, base = best_seconds(
            lambda group=group: evaluate(people, found, group), pycocotools(people, found, keypoints)
        )
        yield Comparison(f"`evaluate`, {group}, {len(keypoints)} keypoints", ours, "the same", base)


def bootstrapping(people: Annotations, found: dict[int, Detections], n_draws: int) -> Comparison:
    evaluation = evaluate(people, found)
    (ours,) = best_seconds(lambda: bootstrap_intervals(evaluation), turns=1)
    # A draw costs pycocotools what the whole set costs.
    (draw,) = best_seconds(pycocotools(people, found, GROUPS["body"]), turns=n_draws)
    return Comparison(
        f"{Draws().n} bootstrap draws from matches", ours, "pycocotools anew for each", draw * Draws().n
    )


_MAIN = "from hicp_lib.cli.main import run; import sys; run(sys.argv[1:])"
_PEAK_KB = "; print([line.split()[1] for line in open('/proc/self/status') if 'VmHWM' in line][0])"


def command(people: Annotations, found: dict[int, Detections]) -> Comparison:
    with tempfile.TemporaryDirectory() as folder:
        options = write(Path(folder), people, found)
        program = [sys.executable, "-c", _MAIN, "evaluate", *options]
        start_s = processor_s()
        subprocess.run(program, check=True, stdout=subprocess.DEVNULL)
        ours = processor_s() - start_s
        (base,) = best_seconds(lambda: [json.loads(Path(p).read_bytes()) for p in options[1::2]], turns=1)
    return Comparison("`hicp evaluate`, all of it", ours, "`json.loads` of its files", base, most_s=2.0)


def write(folder: Path, people: Annotations, found: dict[int, Detections]) -> list[str]:
    """The files of an evaluation, as options."""
    write_annotations(folder / "a.json", people)
    write_detections(folder / "d.json", found)
    return ["--annotations", str(folder / "a.json"), "--detections", str(folder / "d.json")]


def memory(people: Annotations, found: dict[int, Detections]) -> Iterator[Comparison]:
    if not Path("/proc/self/status").is_file():
        return
    with tempfile.TemporaryDirectory() as folder:
        options = write(Path(folder), people, found)
        program = [sys.executable, "-c", _MAIN + _PEAK_KB, "evaluate", *options]
        said = subprocess.run(program, check=True, capture_output=True, text=True).stdout
    n_bytes = people.keypoints_px.nbytes + people.visibility.nbytes
    n_bytes += sum(of.keypoints_px.nbytes + of.scores.nbytes for of in found.values())
    what = f"`hicp evaluate`, {len(people)} people, {N_FOUND} detections each, peak of memory"
    peak_gb = int(said.split()[-1]) * 1024 / 1e9
    yield Comparison(what, peak_gb, "its keypoints in arrays", n_bytes / 1e9, most_s=4.0, unit="GB")


def measure(options) -> Iterator[Comparison]:
    people, found = make_people(options.many)
    yield reading(people, most_s=3.0)
    yield from memory(people, found)
    people, found = make_people(options.images)
    yield reading(people)
    yield from scoring(people, found)
    yield bootstrapping(people, found, options.draws)
    yield command(people, found)


if __name__ == "__main__":
    run(measure, __doc__, images=(1624, 12), draws=(1, 1), many=(10_000, 12))
