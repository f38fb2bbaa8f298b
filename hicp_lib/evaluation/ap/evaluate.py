"""Average precision and recall of keypoint detections by COCO's protocol; its open choices: `options`."""

from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from hicp_lib.core.detections import Detections
from hicp_lib.core.errors import InputError
from hicp_lib.core.keypoints import N_KEYPOINTS, NAMES, SIGMAS
from hicp_lib.core.oks import oks
from hicp_lib.evaluation.ap import cocoeval
from hicp_lib.evaluation.ap.extended_oks import PRESENCE_CUT, extended_oks, known_flags
from hicp_lib.evaluation.ap.options import VISIBLE, Options, choose
from hicp_lib.formats.annotations import SEGMENT_OF_BOX, Annotations

_AT_ONCE = 2**12  # number of images checked at a time


@dataclass(frozen=True)
class Evaluation:
    """How well people are found and their keypoints placed.

    Attributes
    ----------
    group : str
        Of keypoints.
    options : Options
        The options used.
    AP, AP50, AP75, AR, AR50, AR75 : float
        In [0, 1]; NaN without evaluated people.
    n_people : int
        Number of evaluated people (or hands).
    n_ignored : int
        Crowds, other people, people without a labelled keypoint of the group.
    n_images, n_detections : int
        Number of images, and of evaluated detections.
    precision : array, shape (10, 101)
        Per OKS threshold .5:.05:.95 at recall 0:.01:1.
    recall : array, shape (10,)
        Per OKS threshold.
    matches : cocoeval.Matches
        Used by the bootstrap.
    """

    group: str
    options: Options
    AP: float
    AP50: float
    AP75: float
    AR: float
    AR50: float
    AR75: float
    n_people: int
    n_ignored: int
    n_images: int
    n_detections: int
    precision: np.ndarray
    recall: np.ndarray
    matches: cocoeval.Matches

    def metrics(self) -> dict[str, float]:
        """The six metrics by name."""
        return {name: getattr(self, name) for name in cocoeval.METRICS}

    def row(self) -> dict:
        """Group, options, metrics and counts, as one row of a table."""
        counts = ("n_people", "n_ignored", "n_images", "n_detections")
        numbers = self.metrics() | {name: getattr(self, name) for name in counts}
        return {"group": self.group, **asdict(self.options), **numbers}


def evaluate(
    annotations: Annotations, detections: Mapping[int, Detections], group: str = "body", **options: Any
) -> Evaluation:
    """Evaluate detections on every annotated image; an image without an entry has no detections.

    Parameters
    ----------
    annotations : Annotations
        The truth.
    detections : mapping of int to Detections
        By image id.
    group : str
        A key of `OBJECTS`: the 17 keypoints all detectors share, the 42 of the hands, ...
    **options : str
        Fields of `Options`.

    Returns
    -------
    Evaluation

    Raises
    ------
    InputError
        For detections of unknown images or with non-finite scores or coordinates, for unknown groups and
        options, and for area "source" if people have none.
    """
    objects, chosen = choose(group, options)
    images = np.array(sorted(annotations.images), dtype=np.int64)
    slots, found_px, present, scores = _detections_seen(detections, annotations, images, objects, chosen)
    people = people_seen(annotations, objects, chosen)
    truth_px, flags = _flat(people.keypoints_px, objects), _flat(people.visibility, objects)
    boxes_px, areas_px2, is_crowd = (
        np.repeat(of, len(objects), axis=0) for of in (people.boxes_px, people.areas_px2, people.is_crowd)
    )
    sigmas = SIGMAS[chosen.sigmas][objects[0]]

    def similarity(who: np.ndarray, rows: np.ndarray) -> np.ndarray:
        person, found = (boxes_px[who], areas_px2[who]), found_px[rows, None]
        if chosen.outside == "count":
            return extended_oks(truth_px[who], flags[who], *person, found, present[rows, None], sigmas)
        return oks(truth_px[who], flags[who] > 0, *person, found, sigmas)

    counts = (flags != 0).any(axis=1) & ~is_crowd
    person_slots = _slots(np.searchsorted(images, people.image_ids), objects)
    truth = cocoeval.People(person_slots, counts, is_crowd)
    matches = cocoeval.match(images, truth, cocoeval.Found(slots, scores), similarity, len(objects))
    precision, recall = cocoeval.precision_recall(matches)
    n_people = int(matches.n_people.sum())
    return Evaluation(
        group=group,
        options=chosen,
        **{name: float(value) for name, value in cocoeval.metrics(precision, recall).items()},
        n_people=n_people,
        n_ignored=len(truth.slots) - n_people,
        n_images=len(images),
        n_detections=len(scores),
        precision=precision,
        recall=recall,
        matches=matches,
    )


def _flat(values: np.ndarray, objects: np.ndarray) -> np.ndarray:
    """Values of people, (n, 136, ...), as those of their objects, (n * n_objects, k, ...)."""
    return values[:, objects].reshape(len(values) * len(objects), objects.shape[1], *values.shape[2:])


def _slots(image_rows: np.ndarray, objects: np.ndarray) -> np.ndarray:
    """An image has a slot for each object of a person, so that left hands are matched to left hands only."""
    return (image_rows[:, None] * len(objects) + np.arange(len(objects))).ravel()


def check_detections(detections: Mapping[int, Detections], annotations: Annotations) -> None:
    """Refuse detections that would silently distort an evaluation.

    Raises
    ------
    InputError
        As `evaluate`.
    """
    for _ in _checked(detections, annotations):
        pass


def _checked(
    detections: Mapping[int, Detections], annotations: Annotations
) -> Iterator[tuple[np.ndarray, Detections]]:
    """Image ids and detections, in batches of images, so that memory does not hold everything twice."""
    for image_id, found in detections.items():
        if image_id not in annotations.images:
            problem = "not among the annotated images; evaluate them on their own annotations"
            raise InputError(f"detections of image {image_id}: {problem}")
        shapes, n = (found.keypoints_px.shape, found.scores.shape), len(found)
        if shapes != ((n, N_KEYPOINTS, 2), (n, N_KEYPOINTS)):
            expected = f"expected (n, {N_KEYPOINTS}, 2) and (n, {N_KEYPOINTS})"
            raise InputError(f"detections of image {image_id}: shapes {shapes}; {expected}")
    ids, people = np.array(list(detections), dtype=np.int64), list(detections.values())
    for some in (slice(i, i + _AT_ONCE) for i in range(0, len(ids), _AT_ONCE)):
        parts = (vars(of).values() for of in people[some])
        stacked = Detections(*map(np.concatenate, zip(*parts, strict=True)))
        image_ids = np.repeat(ids[some], list(map(len, people[some])))
        _refuse_unsound(stacked, image_ids)
        yield image_ids, stacked


def _refuse_unsound(stacked: Detections, image_ids: np.ndarray) -> None:
    sound = _sound(stacked)
    for i in np.flatnonzero(~(np.isfinite(stacked.person_scores) & sound.all(axis=1)))[:1].tolist():
        where = f"detections of image {image_ids[i]}"
        person = f"person {i - int(np.argmax(image_ids == image_ids[i]))}"
        k = int(sound[i].argmin())
        value = *stacked.keypoints_px[i, k].tolist(), float(stacked.scores[i, k])
        if sound[i, k]:
            score = stacked.person_scores[i]
            raise InputError(f"{where}: score of {person} is {score}; expected a finite number")
        raise InputError(f"{where}: {NAMES[k]} of {person} is {value}; expected finite numbers")


def _sound(found: Detections) -> np.ndarray:
    """Which keypoints are finite, or missing (NaN in both coordinates, with score 0); (n, 136)."""
    u, v = found.keypoints_px[..., 0], found.keypoints_px[..., 1]
    absent = np.isnan(u) & np.isnan(v) & (found.scores == 0)
    return np.isfinite(found.scores) & (absent | np.isfinite(u) & np.isfinite(v))


def people_seen(annotations: Annotations, objects: np.ndarray, options: Options) -> Annotations:
    """The people for an evaluation, with `visibility` and `areas_px2` according to the options.

    Parameters
    ----------
    annotations : Annotations
        All.
    objects : array of int, shape (n_objects, k)
        Keypoints of the group.
    options : Options
        The choices made.

    Returns
    -------
    Annotations
    """
    counts_outside = options.outside == "count"
    flags = known_flags(annotations) if counts_outside else np.maximum(annotations.visibility, 0.0)
    if options.labelled == "visible":
        flags = np.where((flags >= VISIBLE) | (flags < 0), flags, 0.0)
    labelled = (flags[:, objects] != 0).any(axis=(1, 2))
    seen = labelled | annotations.is_crowd | (options.unlabelled == "ignore")
    if options.others == "count":
        seen &= ~annotations.is_other
    people = replace(annotations, visibility=flags)
    people = people if seen.all() else people.take(seen)
    return replace(people, areas_px2=_areas(people, options.area))


def _areas(people: Annotations, area: str) -> np.ndarray:
    box = people.boxes_px[:, 2] * people.boxes_px[:, 3]
    if area == "source":
        return np.array([_source_area(people, i) for i in range(len(people))], dtype=float)
    return {"segment": people.areas_px2, "box": box, "box53": SEGMENT_OF_BOX * box}[area]


def _source_area(people: Annotations, i: int) -> float:
    if people.is_crowd[i]:
        return float(people.areas_px2[i])
    value: Any = people.extras[i].get("source_area")
    if type(value) not in (int, float):
        raise InputError(
            f"annotation {people.ids[i]}: has no 'source_area'; area 'source' is for HiCP folders"
        )
    return float(value)


def _detections_seen(
    detections: Mapping[int, Detections], annotations: Annotations, images: np.ndarray, objects: np.ndarray,
    options: Options,
) -> tuple[np.ndarray, ...]:  # fmt: skip
    """Slots, keypoints, which of them are declared present, and scores of the evaluated objects."""
    n, most, k = 0, len(objects) * sum(map(len, detections.values())), objects.shape[1]
    of_all = np.empty(most, int), np.empty((most, k, 2)), np.empty((most, k), bool), np.empty(most)
    for image_ids, found in _checked(detections, annotations):
        points, of_keypoints = _flat(found.keypoints_px, objects), _flat(found.scores, objects)
        given = np.isfinite(points[..., 0])
        present = given & (of_keypoints >= PRESENCE_CUT)
        of_person = np.repeat(found.person_scores, len(objects))
        scores = of_person if options.score == "person" else of_keypoints.mean(axis=-1)
        slots = _slots(np.searchsorted(images, image_ids), objects)
        seen = given.any(axis=-1) | (options.absent == "count")
        of, n = slice(n, n + int(seen.sum())), n + int(seen.sum())
        for every, some in zip(of_all, (slots, points, present, scores), strict=True):
            every[of] = some[seen]
    return tuple(every[:n] for every in of_all)
