"""Average precision and recall of keypoint detections by COCO's protocol; its open choices: `options`."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
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
_PAIRS_AT_ONCE = 2**9  # whose similarity is computed at a time, to stay in the processor's cache


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
    evaluator = Evaluator(annotations, group, **options)
    for image_ids, found in in_parts(detections, annotations):
        evaluator.add(image_ids, found)
    return evaluator.evaluation()


class Evaluator:
    """Evaluates detections that come some at a time.

    Matches follow from scores and from the OKS of each detection with the people of its image, so these are
    kept, and keypoints are not.

    Parameters
    ----------
    annotations : Annotations
        The truth.
    group : str
        As of `evaluate`.
    **options : str
        As of `evaluate`.

    Raises
    ------
    InputError
        As `evaluate`.
    """

    def __init__(self, annotations: Annotations, group: str = "body", **options: Any) -> None:
        objects, chosen = choose(group, options)
        self._group, self._objects, self._options, self._annotations = group, objects, chosen, annotations
        self._rows, flags, self._areas_px2 = people_seen(annotations, objects, chosen)
        self._flags = flags.reshape(-1, objects.shape[1])  # from here on, of each object of a person
        self._images = np.array(sorted(annotations.images), dtype=np.int64)
        slots = self._slots(annotations.image_ids[self._rows])
        is_crowd = np.repeat(annotations.is_crowd[self._rows], len(objects))
        self._people = cocoeval.People(slots, (self._flags != 0).any(axis=1) & ~is_crowd, is_crowd)
        self._by_slot = np.argsort(slots, kind="stable")
        self._sorted_slots = slots[self._by_slot]
        self._found = [(np.zeros(0, int), np.zeros(0), np.zeros(0, int), np.zeros(0))]

    def add(self, image_ids: np.ndarray, found: Detections) -> None:
        """Add detections; those of an image in their order.

        Parameters
        ----------
        image_ids : array of int, shape (n,)
            The annotated image of each.
        found : Detections
            Of any images.
        """
        objects, options = self._objects, self._options
        points_px, of_keypoints = _flat(found.keypoints_px, objects), _flat(found.scores, objects)
        given = np.isfinite(points_px[..., 0])
        seen = given.any(axis=-1) | (options.absent == "count")
        of_person = np.repeat(found.person_scores, len(objects))
        scores = of_person if options.score == "person" else of_keypoints.mean(axis=-1)
        slots, points_px = self._slots(image_ids)[seen], points_px[seen]
        present = (given & (of_keypoints >= PRESENCE_CUT))[seen]
        # Each detection makes a pair with each of the people in its slot, who are together in `_by_slot`.
        first, past = (np.searchsorted(self._sorted_slots, slots, side) for side in ("left", "right"))
        n = past - first
        who = self._by_slot[np.arange(n.sum()) + np.repeat(first - np.cumsum(n) + n, n)]
        rows, fits = np.repeat(np.arange(len(n)), n), np.empty(len(who))
        for part in (slice(i, i + _PAIRS_AT_ONCE) for i in range(0, len(who), _PAIRS_AT_ONCE)):
            fits[part] = self._fits(who[part], points_px[rows[part]], present[rows[part]])
        self._found.append((slots, scores[seen], n, fits))

    def _slots(self, image_ids: np.ndarray) -> np.ndarray:
        """An image has a slot for each object of a person, so that left hands only match left hands."""
        places, n = np.searchsorted(self._images, image_ids), len(self._objects)
        return (places[:, None] * n + np.arange(n)).ravel()

    def _fits(self, who: np.ndarray, found_px: np.ndarray, present: np.ndarray) -> np.ndarray:
        """Similarity of objects of people, and detections."""
        person, which = np.divmod(who, len(self._objects))
        row = self._rows[person]
        truth_px = self._annotations.keypoints_px[row[:, None], self._objects[which]]
        of_person = self._annotations.boxes_px[row], self._areas_px2[person]
        flags, sigmas = self._flags[who], SIGMAS[self._options.sigmas][self._objects[0]]
        if self._options.outside == "count":
            return extended_oks(truth_px, flags, *of_person, found_px, present, sigmas)
        return oks(truth_px, flags > 0, *of_person, found_px, sigmas)

    def evaluation(self) -> Evaluation:
        """The evaluation of what was added."""
        slots, scores, n, fits = (np.concatenate(of) for of in zip(*self._found, strict=True))
        first = np.cumsum(n) - n
        matches = cocoeval.match(
            self._images, self._people, cocoeval.Found(slots, scores),
            lambda who, rows: fits[first[rows, None] + np.arange(who.shape[1])], len(self._objects),
        )  # fmt: skip
        figures = cocoeval.metrics(*cocoeval.precision_recall(matches))
        n_people = int(matches.n_people.sum())
        return Evaluation(
            group=self._group,
            options=self._options,
            **{name: float(value) for name, value in figures.items()},
            n_people=n_people,
            n_ignored=len(self._flags) - n_people,
            n_images=len(self._images),
            n_detections=len(scores),
            matches=matches,
        )


def _flat(values: np.ndarray, objects: np.ndarray) -> np.ndarray:
    """Values of people, (n, 136, ...), as those of their objects, (n * n_objects, k, ...)."""
    return values[:, objects].reshape(len(values) * len(objects), objects.shape[1], *values.shape[2:])


def check_detections(detections: Mapping[int, Detections], annotations: Annotations) -> None:
    """Refuse detections that would silently distort an evaluation.

    Raises
    ------
    InputError
        As `evaluate`.
    """
    for _ in in_parts(detections, annotations):
        pass


def in_parts(
    detections: Mapping[int, Detections], annotations: Annotations
) -> Iterator[tuple[np.ndarray, Detections]]:
    """Image ids and people of detections, some images at a time, once all are checked."""
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


def people_seen(
    annotations: Annotations, objects: np.ndarray, options: Options
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The people for an evaluation, and what of them the options change.

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
    rows : array of int, shape (n,)
        In `annotations`.
    flags : array of int, shape (n, n_objects, k)
        1 for a keypoint that counts, -1 for one outside the picture that counts, else 0.
    areas_px2 : array, shape (n,)
        The s² of OKS.
    """
    counts_outside = options.outside == "count"
    flags = (known_flags(annotations) if counts_outside else annotations.visibility)[:, objects]
    is_inside = flags >= VISIBLE if options.labelled == "visible" else flags > 0
    signs = is_inside.astype(np.int8) - (counts_outside & (flags < 0))
    seen = signs.any(axis=(1, 2)) | annotations.is_crowd | (options.unlabelled == "ignore")
    if options.others == "count":
        seen &= ~annotations.is_other
    rows = np.flatnonzero(seen)
    return rows, signs[rows], _areas(annotations, rows, options.area)


def _areas(people: Annotations, rows: np.ndarray, area: str) -> np.ndarray:
    segment, of_box = people.areas_px2[rows], people.boxes_px[rows, 2:].prod(axis=1)
    if area != "source":
        return {"segment": segment, "box": of_box, "box53": SEGMENT_OF_BOX * of_box}[area]
    for k in np.flatnonzero(~people.is_crowd[rows]):
        value: Any = people.extras[rows[k]].get("source_area")
        if type(value) not in (int, float):
            problem = "has no 'source_area'; area 'source' is for HiCP folders"
            raise InputError(f"annotation {people.ids[rows[k]]}: {problem}")
        segment[k] = value
    return segment
