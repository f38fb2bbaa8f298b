"""Make `data/examples/native/`: three annotated images and each tool's files for them.

    python tools/native_examples.py [OUT]

Made-up people, no images: `annotations.json`, and a folder per format to try the import with. The first image
has two people, the second none, the third one person; the tools also have results for a fourth image that is
not annotated. Every tool's keypoints are off by a few pixels, with scores in its own scale.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from native_files import (
    Person,
    standing_person,
    write_alphapose,
    write_coco,
    write_detectron2,
    write_mmpose,
    write_openpose,
)

from hicp_lib.formats.annotations import Annotations, ImageInfo, write_annotations

OUT = Path(__file__).parents[1] / "data" / "examples" / "native"
IMAGES = {1: "one_000001.jpg", 2: "two_000002.jpg", 3: "three_000003.jpg"}
ELSEWHERE = "elsewhere_000004.jpg"
PEOPLE = [(1, (220, 240), 380), (1, (430, 250), 350), (3, (320, 230), 420)]  # image, centre, height
# Highest keypoint score: a softmax mass of Detectron2, a maximum of RTMW, a confidence of the others.
HIGHEST = {"openpose": 0.95, "alphapose": 0.98, "mmpose": 8.5, "detectron2": 0.35, "coco": 0.98}


def make_annotations(rng: np.random.Generator) -> Annotations:
    """The people as they are."""
    points = np.array([standing_person(centre, height, rng) for _, centre, height in PEOPLE]).round(2)
    corner = points.min(axis=1)
    size = points.max(axis=1) - corner
    images = {i: ImageInfo(i, name, 640, 480) for i, name in IMAGES.items()}
    ids = np.arange(1, len(PEOPLE) + 1)
    return Annotations(
        images, ids, np.array([image for image, *_ in PEOPLE]), np.hstack([corner, size]).round(2),
        (0.53 * size.prod(axis=1)).round(), np.zeros(len(PEOPLE), dtype=bool), points,
        np.full((len(PEOPLE), 136), 2.0), [{} for _ in PEOPLE],
    )  # fmt: skip


def found_by(format: str, people: Annotations, rng: np.random.Generator) -> dict[str, list[Person]]:
    """The people as a tool finds them."""
    found: dict[str, list[Person]] = {name: [] for name in (*IMAGES.values(), ELSEWHERE)}
    names = [IMAGES[i] for i in people.image_ids.tolist()] + [ELSEWHERE]
    for name, points in zip(names, [*people.keypoints_px, people.keypoints_px[0]], strict=True):
        scores = (HIGHEST[format] * rng.uniform(0.3, 1, 136)).round(3)
        moved = (points + rng.normal(0, 6, points.shape)).round(2)
        found[name].append(Person(moved, scores, round(rng.uniform(0.6, 1), 3)))
    return found


def main() -> None:
    out = Path(sys.argv[1]) if len(sys.argv) > 1 else OUT
    rng = np.random.default_rng(0)
    people = make_annotations(rng)
    write_annotations(out / "annotations.json", people)
    found = {format: found_by(format, people, rng) for format in HIGHEST}
    ids = {name: i for i, name in IMAGES.items()} | {ELSEWHERE: 4}
    write_openpose(out / "openpose", found["openpose"])
    write_alphapose(out / "alphapose" / "alphapose-results.json", found["alphapose"])
    write_mmpose(out / "mmpose", found["mmpose"])
    write_detectron2(out / "detectron2" / "coco_instances_results.json", found["detectron2"], ids)
    write_coco(out / "coco" / "results.json", found["coco"], ids, "coco17")


if __name__ == "__main__":
    main()
