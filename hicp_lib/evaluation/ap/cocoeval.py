"""pycocotools, fed with arrays and kept quiet; and the matches it made, from which AP can be had again."""

from dataclasses import dataclass
from importlib.util import find_spec, module_from_spec
from typing import Any

import numpy as np

OKS_THRESHOLDS = np.linspace(0.5, 0.95, 10)
RECALLS = np.linspace(0.0, 1.0, 101)
METRICS = ("AP", "AP50", "AP75", "AR", "AR50", "AR75")
MAX_DETECTIONS = 20
# Where a keypoint that is not given is put: so far off that it adds 0 to OKS. pycocotools must not
# see NaN: comparisons with NaN fail, and then everything matches.
_FAR_PX = -1e12
_AT_75 = 5  # index into `OKS_THRESHOLDS`


def _quiet(name: str) -> Any:
    """A module of pycocotools as a copy that prints nothing: the caller's standard output is left alone."""
    spec: Any = find_spec(f"pycocotools.{name}")
    module: Any = module_from_spec(spec)
    module.print = lambda *_: None
    spec.loader.exec_module(module)
    return module


COCO, COCOeval = _quiet("coco").COCO, _quiet("cocoeval").COCOeval


@dataclass(frozen=True)
class Matches:
    """Which detections are right, sorted by falling score: all that AP and AR depend on.

    Attributes
    ----------
    image_ids, n_people : array of int, shape (n_images,)
        The images, and the people in each who count.
    image_rows : array of int, shape (n_detections,)
        The detections' rows in `image_ids`.
    is_true, is_false : array of bool, shape (10, n_detections)
        Per OKS threshold; both False if ignored.
    """

    image_ids: np.ndarray
    n_people: np.ndarray
    image_rows: np.ndarray
    is_true: np.ndarray
    is_false: np.ndarray


def truth_row(
    image_id: int, keypoints_px: np.ndarray, visibility: np.ndarray, box_px: np.ndarray, area_px2: float,
    ignored: bool,
) -> dict:  # fmt: skip
    """An annotated person for `run`.

    Parameters
    ----------
    image_id : int
        The image.
    keypoints_px : array, shape (k, 2)
        Of the group.
    visibility : array, shape (k,)
        Above 0 where labelled.
    box_px : array, shape (4,)
        x, y, width, height.
    area_px2 : float
        The s² of OKS.
    ignored : bool
        Whether the person does not count.

    Returns
    -------
    dict
    """
    labelled = visibility > 0
    return {
        "image_id": image_id, "bbox": box_px.tolist(), "area": float(area_px2), "iscrowd": int(ignored),
        "num_keypoints": int(labelled.sum()), "keypoints": _triples(keypoints_px, labelled, 0.0),
    }  # fmt: skip


def found_row(image_id: int, keypoints_px: np.ndarray, score: float) -> dict:
    """A detection for `run`.

    Parameters
    ----------
    image_id : int
        The image.
    keypoints_px : array, shape (k, 2)
        Of the group; NaN where not given.
    score : float
        What detections are ranked by.

    Returns
    -------
    dict
    """
    given = np.isfinite(keypoints_px).all(axis=-1)
    # COCO ignores unmatched detections by their area; with one range over all areas any value does.
    keypoints = _triples(keypoints_px, given, _FAR_PX)
    return {"image_id": image_id, "area": 1.0, "score": float(score), "keypoints": keypoints}


def _triples(keypoints_px: np.ndarray, given: np.ndarray, otherwise: float) -> list[float]:
    points = np.where(given[:, None], keypoints_px, otherwise)
    return np.concatenate([points, given[:, None]], axis=-1).ravel().tolist()


def run(image_ids: list[int], truth: list[dict], found: list[dict], sigmas: np.ndarray) -> Matches:
    """Match detections to people by OKS.

    Parameters
    ----------
    image_ids : list of int
        All images.
    truth, found : list of dict
        Rows from `truth_row` and `found_row`.
    sigmas : array, shape (k,)
        Constants of the keypoints.

    Returns
    -------
    Matches
    """
    cocoeval = COCOeval(_index(image_ids, truth), _index(image_ids, found), "keypoints")
    cocoeval.params.kpt_oks_sigmas = sigmas
    cocoeval.params.maxDets = [MAX_DETECTIONS]
    cocoeval.params.iouThrs, cocoeval.params.recThrs = OKS_THRESHOLDS, RECALLS
    cocoeval.params.areaRng, cocoeval.params.areaRngLbl = [[0.0, np.inf]], ["all"]
    cocoeval.evaluate()
    return _matches(cocoeval)


def _index(image_ids: list[int], rows: list[dict]) -> Any:
    # Ids start at 1: to pycocotools a match with id 0 is no match.
    numbered = [{**row, "id": i, "category_id": 1} for i, row in enumerate(rows, start=1)]
    coco = COCO()
    images = [{"id": i} for i in image_ids]
    coco.dataset = {"images": images, "annotations": numbered, "categories": [{"id": 1}]}
    coco.createIndex()
    return coco


def _matches(cocoeval: Any) -> Matches:
    image_ids = np.array(cocoeval.params.imgIds, dtype=np.int64)
    n_people = np.zeros(len(image_ids), dtype=int)
    none = np.zeros((len(OKS_THRESHOLDS), 0), dtype=bool)
    rows, scores, right, wrong = [np.zeros(0, dtype=int)], [np.zeros(0)], [none], [none]
    for i, image in enumerate(cocoeval.evalImgs):
        if image is not None:
            n_people[i] = np.count_nonzero(np.asarray(image["gtIgnore"]) == 0)
            rows.append(np.full(len(image["dtScores"]), i))
            scores.append(np.array(image["dtScores"], dtype=float))
            matched, counted = image["dtMatches"] > 0, ~image["dtIgnore"]
            right.append(matched & counted)
            wrong.append(~matched)  # over all areas, only matched detections are ever ignored
    order = np.argsort(-np.concatenate(scores), kind="stable")
    true, false = (np.concatenate(parts, axis=1)[:, order] for parts in (right, wrong))
    return Matches(image_ids, n_people, np.concatenate(rows)[order], true, false)


def precision_recall(matches: Matches, weights: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
    """COCO's interpolated precision and final recall when images occur several times, or not at all.

    With all weights 1 this repeats pycocotools to the bit.

    Parameters
    ----------
    matches : Matches
        Which detections are right.
    weights : array of int, shape (n_images,), optional
        How often each image occurs; once when left out.

    Returns
    -------
    precision : array, shape (10, 101)
        NaN when nobody counts.
    recall : array, shape (10,)
        NaN when nobody counts.
    """
    weights = np.ones(len(matches.image_ids), dtype=int) if weights is None else weights
    n_people = int((matches.n_people * weights).sum())
    n_thresholds = len(matches.is_true)
    if n_people == 0:
        return np.full((n_thresholds, len(RECALLS)), np.nan), np.full(n_thresholds, np.nan)
    times = weights[matches.image_rows]
    true = np.cumsum(matches.is_true * times, axis=1, dtype=float)
    false = np.cumsum(matches.is_false * times, axis=1, dtype=float)
    recall = true / n_people
    envelope = np.maximum.accumulate((true / (false + true + np.spacing(1)))[:, ::-1], axis=1)[:, ::-1]
    reached = np.concatenate([envelope, np.zeros((n_thresholds, 1))], axis=1)  # past the last: precision 0
    precision = np.stack([row[np.searchsorted(r, RECALLS)] for row, r in zip(reached, recall, strict=True)])
    return precision, recall[:, -1] if recall.shape[1] else np.zeros(n_thresholds)


def metrics(precision: np.ndarray, recall: np.ndarray) -> dict[str, float]:
    """AP, AP50, AP75, AR, AR50, AR75 from precision (10, 101) and recall (10,).

    Examples
    --------
    >>> metrics(np.full((10, 101), 0.5), np.linspace(1.0, 0.1, 10))["AR75"]
    0.5
    """
    values = [part.mean() for of in (precision, recall) for part in (of, of[0], of[_AT_75])]
    return dict(zip(METRICS, map(float, values), strict=True))
