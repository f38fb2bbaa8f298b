"""Describe annotations and detections."""

from collections.abc import Sequence
from itertools import islice
from pathlib import Path

import numpy as np

from hicp_lib.core.errors import InputError
from hicp_lib.core.files import read_json
from hicp_lib.core.keypoints import HANDS, TO_HALPE
from hicp_lib.formats.annotations import read_annotations
from hicp_lib.formats.importers.importing import READERS
from hicp_lib.formats.importers.people import People
from hicp_lib.formats.importers.scores import score_scale
from hicp_lib.formats.json_validation import PART_KEYS
from hicp_lib.formats.layouts import layouts_of
from hicp_lib.formats.units import count_fractions, fractions_note
from hicp_lib.inspection.facts import Facts, about_people, about_times, tables

MOST_HEADERS = 2000  # number of images of a folder that are examined


def describe_predictions(path: Path, tool: str, origin: str = "") -> Facts:
    """Say what people a tool's files hold.

    Parameters
    ----------
    path : Path
        A file, or a folder of them.
    tool : str
        A key of `hicp_lib.formats.importers.importing.READERS`.
    origin : str, optional
        Remark on the origin of pixels.

    Returns
    -------
    Facts
    """
    people = READERS[tool](path)
    note = fractions_note(path, [count_fractions(people.keypoints_px)])
    layouts = ", ".join(f"{name} {n}" for name, n in people.conventions.items())
    scores, needs = _scores(tool, people)
    says = {
        "people": f"{len(people)} in {len(set(people.source_of.tolist()))} of {len(people.sources)} images",
        "layout": f"{layouts or 'none'}; left is the person's",
        "scores": scores,
        **about_people(people.keypoints_px, "keypoints", origin),
    }
    times_s = sorted({extra["time_s"] for extra in people.extras if "time_s" in extra})
    if times_s:
        says["times"] = about_times(np.array(times_s), "of the video; frames with people")
    return Facts(says, [note] * bool(note), needs)


def _scores(tool: str, people: People) -> tuple[str, dict[str, str]]:
    """Range and scale of keypoint scores in words, and the option that `hicp import` needs."""
    raw = people.raw_scores[np.isfinite(people.keypoints_px).all(axis=-1)]
    if set(raw.tolist()) <= {0.0, 1.0}:
        return ("0 and 1 only: whether found, no scores" if len(raw) else "none"), {}
    span = f"{raw.min():.3g} to {raw.max():.3g}, median {np.median(raw):.3g}"
    try:
        return f"{span}: divided by {score_scale(tool, people):g}, what then passes 1 is cut", {}
    except InputError as error:
        return f"{span}: {str(error).partition('; ')[2]}", {"hicp import": "--score-scale"}


def describe_annotations(path: Path, images_dir: Path | None = None) -> Facts:
    """Say what annotated people a file in COCO's layout holds.

    Parameters
    ----------
    path : Path
    images_dir : Path, optional
        Folder of the images; the sizes of the first are compared with those annotated.

    Returns
    -------
    Facts
    """
    people, rows = read_annotations(path), read_json(path)["annotations"]
    flags = sorted({round(flag, 2) for flag in people.visibility[people.visibility != 0].tolist()})
    boxes_px2 = np.maximum(people.boxes_px[:, 2] * people.boxes_px[:, 3], 1)
    labelled_px = np.where((people.visibility > 0)[..., None], people.keypoints_px, np.nan)
    n_crowds, category = int(people.is_crowd.sum()), people.category
    says = {
        "people": f"{len(people)} in {len(people.images)} images; crowds {n_crowds}; category {category.id}",
        "layout": f"{_layout(rows, category.keypoints)}; left is the person's",
        "flags": f"{str(flags[:6])[1:-1]}; above 0 is labelled" if flags else "nothing is labelled",
        **about_people(labelled_px, "labelled"),
    }
    if len(people):
        says["area"] = f"{np.median(people.areas_px2 / boxes_px2):.2f} of the box in the median"
    written = ["hicp export wrote these: import --format coco"] * any("confidence" in row for row in rows)
    looked_at = islice(people.images.values(), MOST_HEADERS if images_dir else 0)
    other = [problem for image in looked_at if (problem := image.other_size(images_dir or path))]
    sizes = [f"{len(other)} images are not of the annotated size: {other[0]}"] if other else []
    hands = (people.visibility[:, HANDS] > 0).any()
    needs = {} if hands else {"hicp evaluate": "(the body only: no hand is labelled)"}
    return Facts(says, [*written, *sizes, *people.notes.values()], needs)


def _layout(rows: list[dict], names: Sequence[str]) -> str:
    n = {133 if any(map(row.get, PART_KEYS)) else len(row.get("keypoints", ())) // 3 for row in rows}
    if not names:
        return f"{', '.join(map(str, sorted(n)))} keypoints by their number: the file has no names"
    indices = layouts_of("", names)[0][len(names)]
    order = (TO_HALPE[indices] if isinstance(indices, str) else indices).tolist()
    orders = {name: of.tolist() for name, of in TO_HALPE.items()} | tables()["layouts"]
    known = next((name for name, of in orders.items() if of == order), "its own")
    known = "wholebody133" if n == {133} and known == "coco17" else known
    return f"{known}, by the {len(names)} names in its category"
