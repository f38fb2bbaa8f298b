"""Average precision and recall of keypoint detections: COCO's protocol, its open choices explicit.

The options say what tools and papers leave open or do differently; the defaults are the rules of
COCO and COCO-WholeBody with Halpe's sigmas:

- `sigmas`: "halpe" (every hand keypoint .015) or "wholebody" (.017-.047); the body's 17 are the same.
- `labelled`, the keypoints that count: "all" with a label, or "visible": those whose flag says so (2; COCO's
  1 is occluded). Annotators leave many blank that they cannot see, rendered people have them all.
- `area`, the s² of OKS: "segment" (annotated), "box" (width x height), "box53" (0.53 of that, as tools
  do without segments), "source" (the segment before HiCP cut the head off; in HiCP folders only).
- `unlabelled`, people without a labelled keypoint of the group: "ignore" (COCO: they do not count, and
  detections in their surroundings are forgiven) or "drop" (as if not there: such detections are wrong).
- `absent`, detections without a keypoint of the group: "drop" (COCO-WholeBody) or "count" (the Halpe
  tool: each a false positive).
- `others`, the other people in a HiCP crop: "ignore" (detections of them are forgiven) or "count" (wrong).
- `score`, what detections are ranked by: "person", or "group": the mean score of the object's keypoints, 0
  for one that is not given, as it adds 0 to OKS. Bodies go by the first; hands by the second, for the score
  of a person is the body's (COCO-WholeBody ranks hands by it, too).

Both hands of a person are one object of 42 keypoints with sigma .015, as in the Halpe tool (AlphaPose's):
with one of them missing its OKS is at most about .5. "each hand" is COCO-WholeBody's way: every hand an
object of 21, found only on its own side, with that set's sigmas.

A keypoint the detection does not give adds 0 to OKS. Crowds are ignored. The 20 best detections of an
image take part.
"""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from typing import Any, Literal, get_args, get_type_hints

import numpy as np

from hicp_lib.core.detections import Detections
from hicp_lib.core.errors import InputError
from hicp_lib.core.keypoints import GROUPS, HANDS, N_KEYPOINTS, NAMES, SIGMAS
from hicp_lib.core.oks import oks
from hicp_lib.evaluation.ap import cocoeval
from hicp_lib.formats.annotations import Annotations

_SEGMENT_OF_BOX = 0.53  # area of a person's segment over that of the box, as tools take it
OCCLUDED = 1  # COCO's flag of a keypoint that is labelled and cannot be seen
_HAND_OPTIONS = {"score": "group"}
_EACH_HAND_OPTIONS = {"score": "group", "sigmas": "wholebody"}
# What is found one by one, and how unless told otherwise: per group the keypoints of each object of a person.
OBJECTS: dict[str, tuple[np.ndarray, dict[str, str]]] = {
    "body": (GROUPS["body"][None], {}),
    "below the head": (GROUPS["body"][None, 5:], {}),
    "hand": (HANDS[None], _HAND_OPTIONS),
    "each hand": (HANDS.reshape(2, -1), _EACH_HAND_OPTIONS),
    "left hand": (HANDS[None, :21], _EACH_HAND_OPTIONS),
    "right hand": (HANDS[None, 21:], _EACH_HAND_OPTIONS),
}


@dataclass(frozen=True)
class Options:
    """The choices of an evaluation; the module's text explains them.

    Raises
    ------
    InputError
        For a value that is not known.

    Examples
    --------
    >>> Options(area="bbox")
    Traceback (most recent call last):
    hicp_lib.core.errors.InputError: option area='bbox': expected one of segment, box, box53, source
    """

    sigmas: Literal["halpe", "wholebody"] = "halpe"
    labelled: Literal["all", "visible"] = "all"
    area: Literal["segment", "box", "box53", "source"] = "segment"
    unlabelled: Literal["ignore", "drop"] = "ignore"
    absent: Literal["drop", "count"] = "drop"
    others: Literal["ignore", "count"] = "ignore"
    score: Literal["person", "group"] = "person"

    def __post_init__(self) -> None:
        for name, kind in get_type_hints(Options).items():
            if getattr(self, name) not in get_args(kind):
                expected = ", ".join(get_args(kind))
                raise InputError(f"option {name}={getattr(self, name)!r}: expected one of {expected}")


@dataclass(frozen=True)
class Evaluation:
    """How well people are found and their keypoints placed.

    Attributes
    ----------
    group : str
        Of keypoints.
    options : Options
        The choices made.
    AP, AP50, AP75, AR, AR50, AR75 : float
        In [0, 1]; NaN when nobody counts.
    n_people : int
        People (or hands) who count.
    n_ignored : int
        Crowds, other people, people without a labelled keypoint of the group.
    n_images, n_detections : int
        Images, and detections that take part.
    precision : array, shape (10, 101)
        Per OKS threshold .5:.05:.95 at recall 0:.01:1.
    recall : array, shape (10,)
        Per OKS threshold.
    matches : cocoeval.Matches
        What the bootstrap resamples.
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
        """The six figures by name."""
        return {name: getattr(self, name) for name in cocoeval.METRICS}

    def row(self) -> dict:
        """Group, options, figures and counts, as one row of a table."""
        counts = ("n_people", "n_ignored", "n_images", "n_detections")
        numbers = self.metrics() | {name: getattr(self, name) for name in counts}
        return {"group": self.group, **asdict(self.options), **numbers}


def evaluate(
    annotations: Annotations, detections: Mapping[int, Detections], group: str = "body", **options: Any
) -> Evaluation:
    """Evaluate detections on every annotated image; an image without an entry has none.

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
        For detections of unknown images or with scores or coordinates that are no numbers, for unknown
        groups and options, and for area "source" where people have none.
    """
    objects, chosen = choose(group, options)
    image_ids, stacked = check_detections(detections, annotations)
    images = np.array(sorted(annotations.images), dtype=np.int64)
    people = people_seen(annotations, objects, chosen)
    slots, found_px, scores = _detections_seen(np.searchsorted(images, image_ids), stacked, objects, chosen)
    truth_px, labelled = _flat(people.keypoints_px, objects), _flat(people.visibility, objects) > 0
    boxes_px, areas_px2, is_crowd = (
        np.repeat(of, len(objects), axis=0) for of in (people.boxes_px, people.areas_px2, people.is_crowd)
    )
    sigmas = SIGMAS[chosen.sigmas][objects[0]]

    def similarity(who: np.ndarray, rows: np.ndarray) -> np.ndarray:
        return oks(truth_px[who], labelled[who], boxes_px[who], areas_px2[who], found_px[rows, None], sigmas)

    truth = cocoeval.People(
        _slots(np.searchsorted(images, people.image_ids), objects), labelled.any(axis=1) & ~is_crowd, is_crowd
    )
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


def definitions(annotations: Annotations, group: str) -> list[tuple[str, str]]:
    """What belongs side by side: groups and values of `labelled`, the usual ones first.

    Hands as one object and every hand by itself; all labelled keypoints and, where some are marked occluded,
    the visible ones.
    """
    occluded = (annotations.visibility > 0) & (annotations.visibility <= OCCLUDED)
    groups = (group, "each hand") if group == "hand" else (group,)
    return [(of, which) for of in groups for which in (("all", "visible") if occluded.any() else ("all",))]


def choose(group: str, options: Mapping[str, Any]) -> tuple[np.ndarray, Options]:
    """The keypoints of a group's objects, shape (n_objects, k), and the options given over its defaults.

    Raises
    ------
    InputError
        For a group that is not known.
    """
    if group not in OBJECTS:
        raise InputError(f"group {group!r}: expected one of {', '.join(OBJECTS)}")
    objects, defaults = OBJECTS[group]
    return objects, Options(**defaults | dict(options))


def _flat(values: np.ndarray, objects: np.ndarray) -> np.ndarray:
    """Values of people, (n, 136, ...), as those of their objects, (n * n_objects, k, ...)."""
    return values[:, objects].reshape(-1, objects.shape[1], *values.shape[2:])


def _slots(image_rows: np.ndarray, objects: np.ndarray) -> np.ndarray:
    """Left hands meet left hands: an image has a slot for each of a person's objects."""
    return (image_rows[:, None] * len(objects) + np.arange(len(objects))).ravel()


def check_detections(
    detections: Mapping[int, Detections], annotations: Annotations
) -> tuple[np.ndarray, Detections]:
    """Refuse what an evaluator would swallow or stumble over, and put the rest one after the other.

    Returns
    -------
    image_ids : array of int, shape (n,)
        Of the people found.
    found : Detections
        All n of them.

    Raises
    ------
    InputError
        As `evaluate`.
    """
    for image_id, found in detections.items():
        if image_id not in annotations.images:
            problem = "not among the annotated images; evaluate them on their own annotations"
            raise InputError(f"detections of image {image_id}: {problem}")
        shapes, n = (found.keypoints_px.shape, found.scores.shape), len(found)
        if shapes != ((n, N_KEYPOINTS, 2), (n, N_KEYPOINTS)):
            expected = f"expected (n, {N_KEYPOINTS}, 2) and (n, {N_KEYPOINTS})"
            raise InputError(f"detections of image {image_id}: shapes {shapes}; {expected}")
    parts = [
        (of.keypoints_px, of.scores, of.person_scores) for of in (Detections.none(), *detections.values())
    ]
    stacked = Detections(*map(np.concatenate, zip(*parts, strict=True)))
    image_ids = np.repeat(np.array(list(detections), dtype=np.int64), list(map(len, detections.values())))
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
    return image_ids, stacked


def _sound(found: Detections) -> np.ndarray:
    """Which keypoints are finite, or not given: NaN in both coordinates, with score 0; (n, 136)."""
    u, v = found.keypoints_px[..., 0], found.keypoints_px[..., 1]
    absent = np.isnan(u) & np.isnan(v) & (found.scores == 0)
    return np.isfinite(found.scores) & (absent | np.isfinite(u) & np.isfinite(v))


def people_seen(annotations: Annotations, objects: np.ndarray, options: Options) -> Annotations:
    """The people an evaluation sees, with `visibility` and `areas_px2` as the options want them.

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
    visibility = annotations.visibility
    if options.labelled == "visible":
        visibility = np.where(visibility > OCCLUDED, visibility, 0.0)
    labelled = (visibility[:, objects] > 0).any(axis=(1, 2))
    seen = labelled | annotations.is_crowd | (options.unlabelled == "ignore")
    if options.others == "count":
        seen &= ~annotations.is_other
    people = replace(annotations, visibility=visibility).take(seen)
    return replace(people, areas_px2=_areas(people, options.area))


def _areas(people: Annotations, area: str) -> np.ndarray:
    box = people.boxes_px[:, 2] * people.boxes_px[:, 3]
    if area == "source":
        return np.array([_source_area(people, i) for i in range(len(people))], dtype=float)
    return {"segment": people.areas_px2, "box": box, "box53": _SEGMENT_OF_BOX * box}[area]


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
    image_rows: np.ndarray, found: Detections, objects: np.ndarray, options: Options
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Slots, keypoints and scores of the objects that take part."""
    points = _flat(found.keypoints_px, objects)
    of_group = _flat(found.scores, objects).mean(axis=-1)
    scores = np.repeat(found.person_scores, len(objects)) if options.score == "person" else of_group
    seen = np.isfinite(points[..., 0]).any(axis=-1) | (options.absent == "count")
    return _slots(image_rows, objects)[seen], points[seen], scores[seen]
