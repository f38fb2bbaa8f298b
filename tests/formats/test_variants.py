"""One small data set written in two hundred ways: each reads to the same figures, or is refused, or told."""

import copy
import json
from collections import Counter

import numpy as np
import pytest

from hicp_lib.core.errors import InputError
from hicp_lib.core.keypoints import COCO_NAMES
from hicp_lib.evaluation.ap.evaluate import evaluate
from hicp_lib.formats.annotations import read_annotations
from hicp_lib.formats.detections import read_detections

SIZES = [(640, 480), (480, 640), (800, 600)]
SPELLINGS = [str, str.title, lambda n: n.replace("_", " "),
             lambda n: n.replace("left_", "L").replace("right_", "R"),
             lambda n: "_".join(reversed(n.split("_")))]  # fmt: skip


def small_set() -> tuple[dict, list[dict]]:
    """Two people in each of three images, standing; results near them, one far off."""
    rng = np.random.default_rng(4)
    truth = {
        "images": [],
        "annotations": [],
        "categories": [{"id": 1, "name": "person", "keypoints": COCO_NAMES}],
    }
    results = []
    heights = np.array([0.1, 0.08, 0.08, 0.09, 0.09, *np.repeat([0.25, 0.4, 0.5, 0.5, 0.75, 0.95], 2)])
    for i, (width, height) in enumerate(SIZES):
        truth["images"].append({"id": 11 + i, "file_name": f"img_{i}.jpg", "width": width, "height": height})
        for k in range(2):
            w, h = 0.3 * width, 0.7 * height
            x, y = (0.1 + 0.45 * k) * width + 9, 0.2 * height
            points = np.stack([x + w * rng.uniform(0.1, 0.9, 17), y + h * heights], axis=1)
            person = {"id": 7 * i + k, "image_id": 11 + i, "category_id": 1, "bbox": [x, y, w, h]}
            flags = np.full(17, 2.0)
            flags[rng.integers(5, 17, 2)] = 0
            triples = np.concatenate([points, flags[:, None]], axis=1) * (flags > 0)[:, None]
            truth["annotations"].append(person | {"area": 0.5 * w * h, "keypoints": triples.ravel().tolist()})
            found = points + rng.normal(0, 60 if (i, k) == (2, 1) else 5, (17, 2))
            triples = np.concatenate([found, np.ones((17, 1))], axis=1)
            row = {"image_id": 11 + i, "category_id": 1, "keypoints": triples.ravel().tolist()}
            results.append(row | {"score": float(rng.random()), "file_name": f"img_{i}.jpg"})
    return truth, results


def points_of(row: dict) -> np.ndarray:
    return np.array(row["keypoints"], dtype=float).reshape(-1, 3)


def permuted(truth, results, rng):
    order, spell = rng.permutation(17), SPELLINGS[rng.integers(len(SPELLINGS))]
    truth["categories"][0]["keypoints"] = [spell(COCO_NAMES[i]) for i in order]
    for row in truth["annotations"]:
        row["keypoints"] = points_of(row)[order].ravel().tolist()


def unknown_names(truth, results, rng):
    names = list(truth["categories"][0]["keypoints"])
    names[rng.integers(17)] = "point_7"
    truth["categories"][0]["keypoints"] = names


def no_names(truth, results, rng):
    del truth["categories"][0]["keypoints"]


def other_ids(truth, results, rng):
    """The annotations' ids are others, the results' are only right by their files' names."""
    ids = dict(zip([11, 12, 13], rng.permutation([11, 12, 13, 40])[:3].tolist(), strict=True))
    for row in [*truth["images"], *truth["annotations"]]:
        key = "image_id" if "image_id" in row else "id"
        row[key] = ids[row[key]]


def results_of_another_set(truth, results, rng):
    for row in results:
        row["image_id"] += int(rng.integers(1, 900))
        row.pop("file_name", None)


def other_category(truth, results, rng):
    number = int(rng.choice([0, 2, 5]))
    truth["categories"][0] |= {"id": number, "name": str(rng.choice(["person", "Human", "PEOPLE"]))}
    for row in truth["annotations"]:
        row["category_id"] = number


def dogs(truth, results, rng):
    truth["categories"].append({"id": 31, "name": "dog"})
    truth["annotations"].append(
        {"id": 99, "image_id": truth["images"][1]["id"], "category_id": 31, "bbox": [1, 2, 30, 40], "area": 9}
    )


def no_person(truth, results, rng):
    truth["categories"][0]["name"] = "horse"


def fractions(truth, results, rng):
    sizes = {row["id"]: (row["width"], row["height"], 1) for row in truth["images"]}
    for row in results if rng.random() < 0.5 else truth["annotations"]:
        row["keypoints"] = (points_of(row) / sizes[row["image_id"]]).ravel().tolist()


def box_fractions(truth, results, rng):
    sizes = {row["id"]: (row["width"], row["height"]) * 2 for row in truth["images"]}
    for row in truth["annotations"]:
        row["bbox"] = (np.array(row["bbox"]) / sizes[row["image_id"]]).tolist()


def percent(truth, results, rng):
    sizes = {row["id"]: (row["width"] / 100, row["height"] / 100, 1) for row in truth["images"]}
    for row in truth["annotations"]:
        row["keypoints"] = (points_of(row) / sizes[row["image_id"]]).ravel().tolist()


def corners(truth, results, rng):
    for row in truth["annotations"]:
        x, y, w, h = row["bbox"]
        row["bbox"] = [x, y, x + w, y + h]


def bottom_origin(truth, results, rng):
    heights = {row["id"]: row["height"] for row in truth["images"]}
    for row in truth["annotations"]:
        points = points_of(row)
        points[:, 1] = np.where(points[:, 2] > 0, heights[row["image_id"]] - points[:, 1], 0)
        row["keypoints"] = points.ravel().tolist()
        if rng.random() < 0.5:
            row["bbox"][1] = heights[row["image_id"]] - row["bbox"][1] - row["bbox"][3]


def centre_origin(truth, results, rng):
    half = {row["id"]: (row["width"] / 2, row["height"] / 2) for row in truth["images"]}
    for row in truth["annotations"]:
        points = points_of(row)
        points[:, :2] -= np.array(half[row["image_id"]]) * (points[:, 2:] > 0)
        row["keypoints"] = points.ravel().tolist()


def swapped_axes(truth, results, rng):
    for row in truth["annotations"]:
        row["keypoints"] = points_of(row)[:, [1, 0, 2]].ravel().tolist()


def sizes_as_stored(truth, results, rng):
    for image in truth["images"]:
        image["width"], image["height"] = image["height"], image["width"]


def no_area(truth, results, rng):
    value = rng.choice([-1, 0, 1])
    for row in truth["annotations"]:
        row["area"] = int(value)
        if value < 0:
            del row["area"]


SAME = [permuted, other_ids, other_category]
CHANGES = [unknown_names, no_names, results_of_another_set, no_person, fractions, box_fractions, percent,
           corners, bottom_origin, centre_origin, swapped_axes, sizes_as_stored, no_area, dogs]  # fmt: skip


@pytest.fixture
def judged(tmp_path):
    def judged(truth, results) -> tuple[object, dict]:
        paths = tmp_path / "a.json", tmp_path / "d.json"
        for path, content in zip(paths, (truth, results), strict=True):
            path.write_text(json.dumps(content))
        people = read_annotations(paths[0])
        found = read_detections(paths[1], people)
        return [evaluate(people, found, area=area).metrics() for area in ("segment", "box")], people.notes

    return judged


def test_two_hundred_variants_read_alike_or_are_refused_or_told(judged):
    base, notes = judged(*small_set())
    assert 0.5 < base[0]["AP"] < 0.95 and not notes
    outcomes = Counter()
    for seed in range(200):
        rng = np.random.default_rng(seed)
        truth, results = copy.deepcopy(small_set())
        chosen = [change for change in SAME if rng.random() < 0.5]
        chosen += [CHANGES[seed // 2 % len(CHANGES)]] if seed % 2 else []
        for change in sorted(chosen, key=(*CHANGES[:-1], *SAME, dogs).index):
            change(truth, results, rng)
        try:
            figures, notes = judged(truth, results)
        except InputError as refused:
            assert seed % 2 and "\n" not in str(refused), (seed, chosen)
            outcomes["refused"] += 1
            continue
        same = figures == base
        assert same or notes, (seed, chosen)
        assert same or seed % 2, (seed, chosen)
        outcomes["same" if same else "told"] += 1
    assert outcomes.total() == 200 and min(outcomes.values()) > 20 and len(outcomes) == 3
