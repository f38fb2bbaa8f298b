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
- `score`, what detections are ranked by: "person", or "group": the mean score of the keypoints given.

A keypoint the detection does not give adds 0 to OKS. Crowds are ignored. The 20 best detections of an
image take part.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from typing import Literal, get_args, get_type_hints

import numpy as np
import pandas as pd

from hicp_lib.core.detections import Detections
from hicp_lib.core.errors import InputError
from hicp_lib.core.keypoints import GROUPS, N_KEYPOINTS, NAMES, SIGMAS
from hicp_lib.core.oks import oks
from hicp_lib.evaluation.ap import cocoeval as engine
from hicp_lib.formats.annotations import Annotations


@dataclass(frozen=True)
class Options:
    """The choices of an evaluation; the module's text explains them."""

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
    AP, AP50, AP75, AR, AR50, AR75 : floats in [0, 1]; NaN when nobody counts
    n_people : people who count
    n_ignored : crowds, other people, people without a labelled keypoint of the group
    n_images, n_detections : images, and detections that take part
    precision : array, shape (10, 101), per OKS threshold .5:.05:.95 at recall 0:.01:1
    recall : array, shape (10,), per OKS threshold
    matches : what the bootstrap resamples
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
    matches: engine.Matches

    def metrics(self) -> dict[str, float]:
        """The six figures by name."""
        return {name: getattr(self, name) for name in engine.METRICS}

    def row(self) -> dict:
        """Group, options, figures and counts, as one row of a table."""
        counts = ("n_people", "n_ignored", "n_images", "n_detections")
        numbers = self.metrics() | {name: getattr(self, name) for name in counts}
        return {"group": self.group, **asdict(self.options), **numbers}


def evaluate(
    annotations: Annotations, detections: dict[int, Detections], group: str = "body", **options: str
) -> Evaluation:
    """Evaluate detections on every annotated image; an image without an entry has none.

    Parameters
    ----------
    group : "body" (the 17 keypoints all detectors share) or "hand" (42)
    options : fields of `Options`

    Raises
    ------
    InputError
        For detections of unknown images or with scores or coordinates that are no numbers, for unknown
        groups and options, and for area "source" where people have none.
    """
    chosen = Options(**options)
    check_detections(detections, annotations)
    people = _people_seen(annotations, group, chosen)
    keypoints = GROUPS[group]
    truth = [
        engine.truth_row(image_id, *arrays)
        for image_id, *arrays in zip(
            people.image_ids.tolist(), people.keypoints_px[:, keypoints], people.visibility[:, keypoints],
            people.boxes_px, people.areas_px2, people.is_crowd, strict=True,
        )
    ]  # fmt: skip
    found = list(_detections_seen(detections, keypoints, chosen))
    precision, recall, matches = engine.run(
        list(annotations.images), truth, found, SIGMAS[chosen.sigmas][keypoints]
    )
    n_people = int(matches.n_people.sum())
    return Evaluation(
        group=group,
        options=chosen,
        **engine.metrics(precision, recall),
        n_people=n_people,
        n_ignored=len(people) - n_people,
        n_images=len(annotations.images),
        n_detections=len(found),
        precision=precision,
        recall=recall,
        matches=matches,
    )


def check_detections(detections: dict[int, Detections], annotations: Annotations) -> None:
    """Refuse what pycocotools would swallow or stumble over: see `evaluate`."""
    for image_id, found in detections.items():
        where = f"detections of image {image_id}"
        if image_id not in annotations.images:
            raise InputError(
                f"{where}: not among the annotated images; evaluate them on their own annotations"
            )
        shapes = (found.keypoints_px.shape, found.scores.shape)
        if shapes != ((len(found), N_KEYPOINTS, 2), (len(found), N_KEYPOINTS)):
            raise InputError(
                f"{where}: shapes {shapes}; expected (n, {N_KEYPOINTS}, 2) and (n, {N_KEYPOINTS})"
            )
        for i in np.flatnonzero(~np.isfinite(found.person_scores))[:1]:
            raise InputError(
                f"{where}: score of person {i} is {found.person_scores[i]}; expected a finite number"
            )
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
        seen &= ~np.array([bool(extra.get("other")) for extra in annotations.extras], dtype=bool)
    people = annotations.take(seen)
    return replace(people, areas_px2=_areas(people, options.area))


def _areas(people: Annotations, area: str) -> np.ndarray:
    box = people.boxes_px[:, 2] * people.boxes_px[:, 3]
    if area == "source":
        return np.array([_source_area(people, i) for i in range(len(people))], dtype=float)
    return {"segment": people.areas_px2, "box": box, "box53": 0.53 * box}[area]


def _source_area(people: Annotations, i: int) -> float:
    if people.is_crowd[i]:
        return float(people.areas_px2[i])
    value = people.extras[i].get("source_area")
    if type(value) not in (int, float):
        raise InputError(
            f"annotation {people.ids[i]}: has no 'source_area'; area 'source' is for HiCP folders"
        )
    return value


def _detections_seen(
    detections: dict[int, Detections], keypoints: np.ndarray, options: Options
) -> Iterator[dict]:
    for image_id, found in detections.items():
        points = found.keypoints_px[:, keypoints]
        given = np.isfinite(points).all(axis=-1)
        scores = found.person_scores
        if options.score == "group":
            scores = found.scores[:, keypoints].sum(axis=-1) / np.maximum(given.sum(axis=-1), 1)
        for person, any_given, score in zip(points, given.any(axis=-1), scores, strict=True):
            if any_given or options.absent == "count":
                yield engine.found_row(image_id, person, score)


def person_oks(
    annotations: Annotations, detections: dict[int, Detections], group: str = "body", **options: str
) -> pd.DataFrame:
    """OKS of the best-fitting detection for each person who counts, 0 when nobody was found.

    Parameters as for `evaluate`. Columns: `image_id, annotation_id, oks, n_labelled`.
    """
    chosen = Options(**options)
    check_detections(detections, annotations)
    people = _people_seen(annotations, group, chosen)
    keypoints, sigmas = GROUPS[group], SIGMAS[chosen.sigmas][GROUPS[group]]
    labelled = people.visibility[:, keypoints] > 0
    rows = []
    for i in np.flatnonzero(labelled.any(axis=1) & ~people.is_crowd):
        found = detections.get(int(people.image_ids[i]), Detections.none()).keypoints_px[:, keypoints]
        truth = people.keypoints_px[i, keypoints]
        fits = oks(truth, labelled[i], people.boxes_px[i], people.areas_px2[i], found, sigmas)
        rows.append(
            (int(people.image_ids[i]), int(people.ids[i]), fits.max(initial=0.0), int(labelled[i].sum()))
        )
    return pd.DataFrame(rows, columns=["image_id", "annotation_id", "oks", "n_labelled"])


def sensitivity_table(
    annotations: Annotations, detections: dict[int, Detections], group: str = "body"
) -> pd.DataFrame:
    """How the figures move when one option at a time leaves its default.

    Columns: `changed` ("default", or e.g. "area=box"), those of `Evaluation.row`, and `AP_change` against
    the default. Area "source" is left out where people have none.
    """
    counted = np.flatnonzero(~annotations.is_crowd)
    has_source = all("source_area" in annotations.extras[i] for i in counted)
    variants: list[dict[str, str]] = [{}]
    for name, kind in get_type_hints(Options).items():
        variants += [{name: value} for value in get_args(kind)[1:] if value != "source" or has_source]
    rows = []
    for variant in variants:
        changed = ", ".join(f"{name}={value}" for name, value in variant.items()) or "default"
        rows.append({"changed": changed, **evaluate(annotations, detections, group, **variant).row()})
    table = pd.DataFrame(rows)
    return table.assign(AP_change=table["AP"] - table["AP"].iloc[0])
