"""Average precision and recall of keypoint detections: COCO's protocol, its open choices explicit.

The options say what tools and papers leave open or do differently; the defaults are the rules of
COCO and COCO-WholeBody with Halpe's sigmas:

- `sigmas`: "halpe" (every hand keypoint .015) or "wholebody" (.017-.047); the body's 17 are the same.
- `area`, the s² of OKS: "segment" (annotated), "box" (width x height), "box53" (0.53 of that, as tools
  do without segments), "source" (the segment before HiCP cut the head off; in HiCP folders only).
- `unlabelled`, people without a labelled keypoint of the group: "ignore" (COCO: they do not count, and
  detections in their surroundings are forgiven) or "drop" (as if not there: such detections are wrong).
- `absent`, detections without a keypoint of the group: "drop" (COCO-WholeBody) or "count" (the Halpe
  tool: each a false positive).
- `others`, the other people in a HiCP crop: "ignore" (detections of them are forgiven) or "count" (wrong).
- `score`, what detections are ranked by: "person", or "group": the mean score of the group's keypoints, 0 for
  one that is not given, as it adds 0 to OKS. Bodies go by the first; hands by the second, for the score of a
  person is the body's (COCO-WholeBody ranks hands by it, too).

A keypoint the detection does not give adds 0 to OKS. Crowds are ignored. The 20 best detections of an
image take part.
"""

from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, replace
from typing import Any, Literal, get_args, get_type_hints

import numpy as np
import pandas as pd

from hicp_lib.core.detections import Detections
from hicp_lib.core.errors import InputError
from hicp_lib.core.keypoints import GROUPS, N_KEYPOINTS, NAMES, SIGMAS
from hicp_lib.evaluation.ap import cocoeval
from hicp_lib.evaluation.matching import best_oks
from hicp_lib.formats.annotations import Annotations

_SEGMENT_OF_BOX = 0.53  # area of a person's segment over that of the box, as tools take it


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
        People who count.
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
    group : {"body", "hand"}
        The 17 keypoints all detectors share, or the 42 of the hands.
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
    chosen = Options(**_defaults(group) | options)
    check_detections(detections, annotations)
    people = _people_seen(annotations, group, chosen)
    keypoints = GROUPS[group]
    truth = [
        cocoeval.truth_row(image_id, *arrays)
        for image_id, *arrays in zip(
            people.image_ids.tolist(), people.keypoints_px[:, keypoints], people.visibility[:, keypoints],
            people.boxes_px, people.areas_px2, people.is_crowd, strict=True,
        )
    ]  # fmt: skip
    found = list(_detections_seen(detections, keypoints, chosen))
    matches = cocoeval.run(list(annotations.images), truth, found, SIGMAS[chosen.sigmas][keypoints])
    precision, recall = cocoeval.precision_recall(matches)
    n_people = int(matches.n_people.sum())
    return Evaluation(
        group=group,
        options=chosen,
        **cocoeval.metrics(precision, recall),
        n_people=n_people,
        n_ignored=len(people) - n_people,
        n_images=len(annotations.images),
        n_detections=len(found),
        precision=precision,
        recall=recall,
        matches=matches,
    )


def _defaults(group: str) -> dict[str, Any]:
    return {"score": "group"} if group == "hand" else {}


def check_detections(detections: Mapping[int, Detections], annotations: Annotations) -> None:
    """Refuse what pycocotools would swallow or stumble over.

    Raises
    ------
    InputError
        As `evaluate`.
    """
    for image_id, found in detections.items():
        where = f"detections of image {image_id}"
        if image_id not in annotations.images:
            raise InputError(
                f"{where}: not among the annotated images; evaluate them on their own annotations"
            )
        shapes, n = (found.keypoints_px.shape, found.scores.shape), len(found)
        if shapes != ((n, N_KEYPOINTS, 2), (n, N_KEYPOINTS)):
            raise InputError(
                f"{where}: shapes {shapes}; expected (n, {N_KEYPOINTS}, 2) and (n, {N_KEYPOINTS})"
            )
        for i, score in enumerate(found.person_scores):
            if not np.isfinite(score):
                raise InputError(f"{where}: score of person {i} is {score}; expected a finite number")
        # A keypoint that is not given is NaN in both coordinates and has score 0; all others are finite.
        given = ~np.isnan(found.keypoints_px).all(axis=-1)
        sound = np.where(given, np.isfinite(found.keypoints_px).all(axis=-1), found.scores == 0)
        for i, k in np.argwhere(~(sound & np.isfinite(found.scores)))[:1]:
            value = (*found.keypoints_px[i, k].tolist(), float(found.scores[i, k]))
            raise InputError(f"{where}: {NAMES[k]} of person {i} is {value}; expected finite numbers")


def _people_seen(annotations: Annotations, group: str, options: Options) -> Annotations:
    """The people an evaluation sees, with `areas_px2` as the options want them."""
    if group not in GROUPS:
        raise InputError(f"group {group!r}: expected one of {', '.join(GROUPS)}")
    labelled = (annotations.visibility[:, GROUPS[group]] > 0).any(axis=1)
    seen = labelled | annotations.is_crowd | (options.unlabelled == "ignore")
    if options.others == "count":
        seen &= ~annotations.is_other
    people = annotations.take(seen)
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
    detections: Mapping[int, Detections], keypoints: np.ndarray, options: Options
) -> Iterator[dict]:
    for image_id, found in detections.items():
        points = found.keypoints_px[:, keypoints]
        given = np.isfinite(points).all(axis=-1).any(axis=-1)
        scores = {"person": found.person_scores, "group": found.scores[:, keypoints].mean(axis=-1)}
        for person, any_given, score in zip(points, given, scores[options.score], strict=True):
            if any_given or options.absent == "count":
                yield cocoeval.found_row(image_id, person, score)


def person_oks(
    annotations: Annotations, detections: Mapping[int, Detections], group: str = "body", **options: Any
) -> pd.DataFrame:
    """OKS of the best-fitting detection for each person who counts, 0 when nobody was found.

    Parameters
    ----------
    annotations : Annotations
        The truth.
    detections : mapping of int to Detections
        By image id.
    group : {"body", "hand"}
        Of keypoints.
    **options : str
        Fields of `Options`.

    Returns
    -------
    DataFrame
        Columns `image_id, annotation_id, oks, n_labelled`.
    """
    chosen = Options(**_defaults(group) | options)
    check_detections(detections, annotations)
    people = _people_seen(annotations, group, chosen)
    keypoints = GROUPS[group]
    n_labelled = (people.visibility[:, keypoints] > 0).sum(axis=1)
    rows = [
        (people.image_ids[i], people.ids[i], fit, n_labelled[i])
        for i, fit in best_oks(people, detections, keypoints, SIGMAS[chosen.sigmas][keypoints])
    ]
    return pd.DataFrame(rows, columns=["image_id", "annotation_id", "oks", "n_labelled"])


def sensitivity_table(
    annotations: Annotations, detections: Mapping[int, Detections], group: str = "body"
) -> pd.DataFrame:
    """How the figures move when one option at a time leaves its default.

    Parameters
    ----------
    annotations : Annotations
        The truth.
    detections : mapping of int to Detections
        By image id.
    group : {"body", "hand"}
        Of keypoints.

    Returns
    -------
    DataFrame
        Columns `changed` ("default", or e.g. "area=box"), those of `Evaluation.row`, and `AP_change` against
        the default. Area "source" is left out where people have none.
    """
    counted = np.flatnonzero(~annotations.is_crowd)
    has_source = all("source_area" in annotations.extras[i] for i in counted)
    variants: dict[str, dict[str, str]] = {"default": {}}
    default = asdict(Options(**_defaults(group)))
    for name, kind in get_type_hints(Options).items():
        values = [v for v in get_args(kind) if v != default[name] and (v != "source" or has_source)]
        variants |= {f"{name}={value}": {name: value} for value in values}
    table = pd.DataFrame(
        {"changed": changed, **evaluate(annotations, detections, group, **variant).row()}
        for changed, variant in variants.items()
    )
    return table.assign(AP_change=table["AP"] - table["AP"].iloc[0])
