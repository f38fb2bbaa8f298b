"""Made-up files in CropCOCO's layout, and what exococotools makes of them.

    python tests/evaluation/ap/cropped_people.py    # with exococotools: writes extended_oks.json

exococotools (1.0.0) is the tool of extended OKS's authors, under the GPL: its numbers are kept here, none of
its code. It works windows out in single precision; sides that are multiples of 12 make that exact.
"""

import json
from pathlib import Path

import numpy as np

NUMBERS = Path(__file__).with_name("extended_oks.json")
WIDTH, HEIGHT = 640, 480
SEEDS = range(6)


def cropped_people(seed: int) -> tuple[dict, list[dict]]:
    """Annotations and results; every picture has somebody who counts.

    Odd seeds have people without a label and crowds, even ones keypoints that are not given; the last
    two have `pad_to_contain`.
    """
    rng = np.random.default_rng(seed)
    people, results = [], []
    for image_id in range(1, 9):
        for place in range(rng.integers(1, 4)):
            unlabelled = bool(seed % 2) and place > 0 and rng.random() < 0.4
            person = _person(rng, unlabelled, pad=seed > 3)
            person |= {"id": len(people) + 1, "image_id": image_id, "category_id": 1}
            people.append(person)
            results += [_result(rng, person, gaps=not seed % 2) for _ in range(rng.integers(0, 3))]
    images = [{"id": i, "file_name": f"{i}.png", "width": WIDTH, "height": HEIGHT} for i in range(1, 9)]
    return {"images": images, "annotations": people, "categories": [{"id": 1, "name": "person"}]}, results


def _person(rng: np.random.Generator, unlabelled: bool, pad: bool) -> dict:
    box = rng.integers(1, 30, 4) * 12
    points = box[:2] + rng.uniform(-0.4, 1.4, (17, 2)) * box[2:]
    within = ((points > 0) & (points < [WIDTH - 1, HEIGHT - 1])).all(axis=1)
    inside, outside = rng.choice([0, 1, 2], 17, p=[0.2, 0.2, 0.6]), rng.choice([0, 3], 17, p=[0.1, 0.9])
    flags = np.where(within, inside, outside)
    flags = np.zeros(17) if unlabelled else np.r_[2, flags[1:]]
    placed = (flags > 0) & ((flags < 3) | pad | (rng.random(17) < 0.5))
    triples = np.column_stack([np.where(placed[:, None], points, 0), flags])
    area = float(box[2] * box[3] * rng.uniform(0.3, 0.9))
    person = {"bbox": box.tolist(), "area": area, "iscrowd": int(unlabelled and rng.random() < 0.5)}
    person |= {"keypoints": triples.ravel().tolist(), "num_keypoints": int((flags > 0).sum())}
    if pad:
        person["pad_to_contain"] = np.where(flags > 0, rng.uniform(1, 1.5, 17), -1).tolist()
    return person


def _result(rng: np.random.Generator, person: dict, gaps: bool) -> dict:
    points = np.reshape(person["keypoints"], (17, 3))[:, :2]
    spread = rng.choice([0.5, 2, 8])
    points = np.where(points == 0, person["bbox"][:2], points) + rng.normal(0, spread, (17, 2))
    outside = np.array(person["keypoints"][2::3]) == 3
    outside = np.array(person.get("pad_to_contain", outside * 2)) > 1.25
    scores = np.clip(rng.normal(np.where(outside, 0.3, 0.8), 0.15), 0.01, 1)
    triples = np.column_stack([points, scores]) * (rng.random((17, 1)) > 0.15 * gaps)
    row = {"image_id": person["image_id"], "category_id": 1, "score": round(float(scores.mean()), 1)}
    return row | {"keypoints": triples.ravel().tolist()}


def main() -> None:
    """Ask exococotools."""
    from exococotools.coco import COCO
    from exococotools.cocoeval import COCOeval

    names = {"AP": "AP", "AP50": "AP .5", "AP75": "AP .75", "AR": "AR", "AR50": "AR .5", "AR75": "AR .75"}
    numbers = {}
    for seed in SEEDS:
        truth, results = cropped_people(seed)
        annotated = COCO()
        annotated.dataset = truth
        annotated.createIndex()
        run = COCOeval(annotated, annotated.loadRes(results), "keypoints", extended_oks=True)
        run.evaluate()
        run.accumulate()
        run.summarize()
        stats = dict(zip(run.stats_names, run.stats, strict=True))
        # By picture: a row for each detection, the surest first, a column for each person.
        similarity = {i: np.array(run.ious[i, 1][0]).tolist() for i in map(int, run.params.imgIds)}
        numbers[seed] = {"metrics": {k: float(stats[v]) for k, v in names.items()}, "similarity": similarity}
    NUMBERS.write_text(json.dumps(numbers))


if __name__ == "__main__":
    main()
