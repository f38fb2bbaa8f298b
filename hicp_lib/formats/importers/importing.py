"""Predictions of other tools, from their own files to `Detections` by image id.

The `read_*` function of each format returns people and the names of their images; here they are matched with
the annotated images, scores are scaled to [0, 1], and the matching is summarised.
`hicp_lib.formats.detections.write_detections` writes the detections with the tool's own scores and keys
(`Imported.extras`) beside them.
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from hicp_lib.core.detections import Detections
from hicp_lib.core.errors import InputError, refuse_unknown
from hicp_lib.core.folders import listed
from hicp_lib.core.images import inside
from hicp_lib.formats.annotations import Annotations, rows_by_image
from hicp_lib.formats.detection_files import RAW_SCORES
from hicp_lib.formats.importers.matching import ImageMatcher
from hicp_lib.formats.importers.mmpose import read_mmpose
from hicp_lib.formats.importers.openpose import read_openpose, refuse_other_size
from hicp_lib.formats.importers.people import People
from hicp_lib.formats.importers.results import ALPHAPOSE, COCO, DETECTRON2, read_results
from hicp_lib.formats.importers.scores import score_scale
from hicp_lib.formats.units import count_fractions, fractions_note

_LEAST_IMAGES = 5  # needed to decide whether coordinates are of another size
_OFF, _ALIKE = np.log(1.25), 0.1  # logarithms of ratios: another size, and equal in both directions
READERS: dict[str, Callable[[Path], People]] = {
    "openpose": read_openpose,
    "alphapose": lambda path: read_results(path, ALPHAPOSE),
    "mmpose": read_mmpose,
    "detectron2": lambda path: read_results(path, DETECTRON2),
    "coco": lambda path: read_results(path, COCO),
}


@dataclass(frozen=True)
class Imported:
    """Detections of every annotated image, and the tool's further data.

    Attributes
    ----------
    detections : dict of int to Detections
        By image id, in the order of the annotations; keypoint scores in [0, 1], divided by the scale and
        clipped; person scores as the tool wrote them.
    extras : dict of int to list of dict
        By image id, per person `raw_keypoint_scores` (136 in Halpe's order, 0 where not given) and the
        further keys of the tool's file, such as its box.
    summary : dict
        How the predictions matched the images, ready for JSON: `format`; `n_images` annotated; those that the
        files mention, `n_with_people` and `n_without_people`; `n_not_mentioned`, where nobody was found or
        the tool did not look; `unmatched`, images in the files that are not annotated, whose people are left
        out; `n_people` imported; `conventions`, people per keypoint convention, unmatched ones included;
        `score_range`, lowest, median and highest keypoint score as the tool wrote them; `score_scale`, what
        they were divided by, and `n_cut`, how many were then clipped to 1; `n_keypoints` given, and
        `n_outside` of their image; `n_passed_over`, files in JSON that are not named as the others; `notes`,
        what is doubtful.
    """

    detections: dict[int, Detections]
    extras: dict[int, list[dict]]
    summary: dict[str, Any]


def import_predictions(
    format: str, path: str | Path, annotations: Annotations, scale: float | None = None
) -> Imported:
    """Read another tool's predictions for annotated images.

    Parameters
    ----------
    format : str
        A key of `READERS`.
    path : str or Path
        The folder or file the tool wrote.
    annotations : Annotations
        Of the images the tool ran on.
    scale : float, optional
        What keypoint scores are divided by; by default that of the format, see `scores`.

    Returns
    -------
    Imported

    Raises
    ------
    InputError
        For anything malformed, coordinates that are not pixels of these images, images that match none or
        several; the message names the file, the entry, the key, what was expected and what to do.
    """
    refuse_unknown("format", format, READERS)
    if scale is not None and not 0 < scale < np.inf:
        raise InputError(f"--score-scale is {scale:g}; expected a positive number")
    people = READERS[format](Path(path))
    note = fractions_note(people.path, [count_fractions(people.keypoints_px)])
    matched = ImageMatcher(people.path, people.named_by, annotations.images).match(people.sources)
    scale = score_scale(format, people) if scale is None else scale
    rows = np.flatnonzero([matched[s] is not None for s in people.source_of])
    shown = [annotations.images[i] for s in people.source_of if (i := matched[s]) is not None]
    sizes = np.array([(image.width_px, image.height_px) for image in shown]).reshape(-1, 2)
    if format == "openpose":
        refuse_other_size(people.path, people.keypoints_px[rows], sizes)
    image_ids = np.array([matched[s] for s in people.source_of[rows]], dtype=np.int64)
    _refuse_other_scale(people.path, people.keypoints_px[rows], image_ids, annotations)
    detections, extras = _by_image(people, matched, annotations, scale)
    summary = _summary(format, people, matched, annotations, rows, sizes, scale)
    return Imported(detections, extras, summary | {"notes": [note] * bool(note)})


def _refuse_other_scale(
    path: Path, points_px: np.ndarray, image_ids: np.ndarray, annotations: Annotations
) -> None:
    """Refuse coordinates of images of another size: people too small or large, equally in both directions."""
    ends_px = pd.DataFrame(np.nan_to_num(points_px, nan=-np.inf).max(axis=1)).groupby(image_ids).max()
    boxes_px = annotations.boxes_px[:, :2] + annotations.boxes_px[:, 2:]
    ratios = ends_px / pd.DataFrame(boxes_px).groupby(annotations.image_ids).max()
    logs = np.log(ratios[(ratios > 0) & (ratios < np.inf)].dropna())
    middle = logs.median()
    alike = abs(middle[0] - middle[1]) < _ALIKE and ((logs - middle).abs().median() < _ALIKE).all()
    if len(logs) >= _LEAST_IMAGES and alike and (middle.abs() > _OFF).all():
        raise InputError(
            f"{path}: people end at {np.exp(middle.mean()):.2f} of where the annotated ones do, across and "
            "down; expected pixels of the annotated images: of OpenPose, run it with --keypoint_scale 0"
        )


def _by_image(
    people: People, matched: list[int | None], annotations: Annotations, scale: float
) -> tuple[dict[int, Detections], dict[int, list[dict]]]:
    scores = np.clip(people.raw_scores / scale, 0.0, 1.0)
    raw = people.raw_scores.tolist()
    detections = dict.fromkeys(annotations.images, Detections.none())
    extras: dict[int, list[dict]] = {image: [] for image in annotations.images}
    for source, rows in rows_by_image(people.source_of).items():
        if (image := matched[source]) is not None:
            points = people.keypoints_px[rows]
            detections[image] = Detections(points, scores[rows], people.person_scores[rows])
            extras[image] = [people.extras[i] | {RAW_SCORES: raw[i]} for i in rows.tolist()]
    return detections, extras


def _summary(
    format: str, people: People, matched: list[int | None], annotations: Annotations, rows: np.ndarray,
    sizes_px: np.ndarray, scale: float,
) -> dict[str, Any]:  # fmt: skip
    points, raw, path = people.keypoints_px[rows], people.raw_scores[rows], people.path
    given = np.isfinite(points).all(axis=-1)
    outside = given & ~inside(points, (0, 0, *sizes_px.T[..., None]))
    n_mentioned = sum(image is not None for image in matched)
    n_images, n_with = len(annotations.images), len(set(people.source_of[rows].tolist()))
    return {
        "format": format,
        "n_images": n_images,
        "n_with_people": n_with,
        "n_without_people": n_mentioned - n_with,
        "n_not_mentioned": n_images - n_mentioned,
        "unmatched": [str(s) for s, image in zip(people.sources, matched, strict=True) if image is None],
        "n_people": len(rows),
        "conventions": dict(people.conventions),
        "score_range": np.quantile(raw[given], [0, 0.5, 1]).tolist() if given.any() else [0.0, 0.0, 0.0],
        "score_scale": float(scale),
        "n_cut": int((raw > scale).sum()),
        "n_keypoints": int(given.sum()),
        "n_outside": int(outside.sum()),
        "n_passed_over": len(listed(path, ".json")) - len(people.sources) if path.is_dir() else 0,
    }


def summary_lines(summary: dict[str, Any]) -> list[str]:
    """The summary of an import as text lines."""
    low, middle, high = summary["score_range"]
    keys = "score_scale", "n_cut", "unmatched", "n_passed_over"
    scale, n_cut, unmatched, rest = (summary[key] for key in keys)
    scaled = f"divided by {scale:g}" if scale != 1 else "taken as they are"
    named = f" ({', '.join(map(repr, unmatched[:3]))}{', ...' if len(unmatched) > 3 else ''})"
    per_convention = ", ".join(f"{name} {n}" for name, n in summary["conventions"].items())
    return [
        "{format}: {n_people} people in {n_with_people} of {n_images} images; "
        "{n_without_people} with nobody, {n_not_mentioned} not mentioned".format(**summary),
        f"people per convention: {per_convention}",
        f"keypoint scores {low:.3g} to {high:.3g}, median {middle:.3g}: {scaled}, {n_cut} cut to 1",
        "keypoints outside their image: {n_outside} of {n_keypoints}".format(**summary),
        f"not annotated and left out: {len(unmatched)} images{named if unmatched else ''}",
        *([f"passed over: {rest} files in JSON, not named as the others"] if rest else []),
        *summary["notes"],
    ]
