"""What a JSON file is: annotations, detections of any tool, a camera."""

from pathlib import Path
from typing import Any

import numpy as np

from hicp_lib.core.errors import InputError
from hicp_lib.core.files import read_json
from hicp_lib.core.keypoints import N_KEYPOINTS
from hicp_lib.formats.annotations import read_annotations
from hicp_lib.formats.importers.importing import READERS
from hicp_lib.formats.units import refuse_fractions
from hicp_lib.inspection.facts import Facts, about_people, about_scores
from hicp_lib.mocap.registration import read_registration
from hicp_lib.recordings.camera_file import read_distorted_camera

ORIGIN = "top left, pixel centres at integers"
_RESULTS = {  # format of the importer -> what it is called, and where its pixels' origin lies
    "coco": ("COCO keypoint results", f"{ORIGIN} (COCO's convention; the file does not say)"),
    "detectron2": ("Detectron2's COCO results", ORIGIN),
    "alphapose": ("AlphaPose results", ORIGIN),
    "openpose": ("OpenPose keypoints", ORIGIN),
    "mmpose": ("MMPose predictions", ORIGIN),
}


def inspect_json(path: Path) -> Facts:
    """Say what a JSON file is.

    Parameters
    ----------
    path : Path

    Returns
    -------
    Facts

    Raises
    ------
    InputError
        If it is not JSON, or of no kind that is known.
    """
    value = read_json(path)
    if isinstance(value, dict):
        for keys, inspected in _OBJECTS:
            if keys <= set(value):
                return inspected(path, value)
    elif isinstance(value, list):
        if not value:
            return Facts(path, "an empty list: nobody was found", needs={"hicp evaluate": "--annotations"})
        if isinstance(value[0], dict):
            return _list(path, value)
    raise InputError(f"{path}: JSON of no kind that is known; see the page on files of other tools")


def inspect_predictions(path: Path, tool: str) -> Facts:
    """Say what people a tool's files hold.

    Parameters
    ----------
    path : Path
        A file, or a folder of them.
    tool : str
        A key of `hicp_lib.formats.importers.importing.READERS`.

    Returns
    -------
    Facts
    """
    kind, origin = _RESULTS[tool]
    people = READERS[tool](path)
    refuse_fractions(path, people.keypoints_px)
    known = np.isfinite(people.keypoints_px).all(axis=-1)
    layouts = ", ".join(f"{name} {n}" for name, n in people.conventions.items())
    says = {
        "people": f"{len(people)} in {len(people.sources)} images, named by {people.named_by}",
        "layout": f"{layouts or 'none'}; left is the person's",
        "scores": about_scores(people.raw_scores[known]),
        **about_people(people.keypoints_px, "keypoints"),
        "pixel origin": origin,
    }
    return Facts(path, kind, says, needs={"hicp import": f"--format {tool}, --annotations of the images"})


def _annotations(path: Path, value: dict) -> Facts:
    categories = value.get("categories") or []
    named = [len(c.get("keypoints") or []) for c in categories if isinstance(c, dict)]
    try:
        people = read_annotations(path)
    except InputError as error:
        return Facts(path, "COCO annotations", problem=str(error).removeprefix(f"{path}: "))
    per_person = sorted({len(a.get("keypoints", ())) // 3 for a in value["annotations"]})
    flags = sorted(set(np.round(people.visibility[people.visibility != 0], 2).tolist()))
    areas = people.areas_px2 / np.maximum(people.boxes_px[:, 2] * people.boxes_px[:, 3], 1)
    points_px = np.where((people.visibility > 0)[..., None], people.keypoints_px, np.nan)
    hands = (people.visibility[:, 94:] > 0).any()
    says = {
        "people": f"{len(people)} in {len(people.images)} images; crowds {int(people.is_crowd.sum())}",
        "layout": f"{', '.join(map(str, per_person)) or 'no'} keypoints a person; "
        + (f"by the names of its category ({max(named)})" if any(named) else "by their number"),
        "flags": f"{flags[:6]}; 0 is not labelled" if flags else "nothing is labelled",
        **about_people(points_px),
        "area": f"{np.median(areas):.2f} of the box in the median" if len(areas) else "none",
        "pixel origin": ORIGIN,
    }
    missing = "" if hands else "; no hands, so the body only"
    needs = {
        "hicp dataset create": "--images, the folder of its pictures",
        "hicp evaluate": f"--detections{missing}",
    }
    return Facts(path, "COCO annotations of people", says, list(people.notes.values()), needs)


def _list(path: Path, rows: list) -> Facts:
    first = rows[0]
    if {"id", "file_name"} <= set(first):
        return Facts(path, "names of images by id", {"images": str(len(rows))})
    if "keypoint_scores" in first:
        return inspect_predictions(path, "mmpose")
    if isinstance(first.get("keypoints"), list) and "image_id" in first:
        if isinstance(first["image_id"], str):
            return inspect_predictions(path, "alphapose")
        facts = inspect_predictions(path, "coco")
        by_name = sum("file_name" in row for row in rows)
        kind = "detections by hicp detect" if by_name == len(rows) else facts.kind
        complete = len(first["keypoints"]) == 3 * N_KEYPOINTS
        needs = {"hicp evaluate": "--annotations", "hicp draw": "--images"} if complete else facts.needs
        return Facts(path, kind, facts.says, facts.notes, needs)
    raise InputError(f"{path}: a list of objects of no kind that is known ({', '.join(sorted(first)[:6])})")


def _camera(path: Path, value: dict) -> Facts:
    scale = value.get("depth_scale")
    camera, _, distorted_px = read_distorted_camera(path, None if "depth_scale" in value else 1.0)
    says = {
        "image": f"{camera.width_px} x {camera.height_px} pixels",
        "focal lengths": f"{camera.fx_px:.2f}, {camera.fy_px:.2f} pixels",
        "principal point": f"{camera.cx_px:.2f}, {camera.cy_px:.2f} pixels",
        "pixel origin": ORIGIN,
        "depth": f"{scale:g} units per metre" if scale else "its unit is not in the file",
        "distortion": "none" if distorted_px is None else "some; undone on import",
    }
    needs = {"hicp record import": "" if scale else "--depth-scale; the folder it lies in"}
    return Facts(path, "intrinsics of a camera", says, needs=needs if not scale else {})


def _registration(path: Path, value: dict) -> Facts:
    registration = read_registration(path)
    place_m = registration.T_base_mocap[:3, 3]
    says = {
        "found by": registration.method,
        "translation": "{:.3f}, {:.3f}, {:.3f} m".format(*place_m),
        "units": "metres; motion capture to the robot's base",
    }
    return Facts(path, "registration of motion capture", says)


_OBJECTS: list[tuple[set[str], Any]] = [
    ({"images", "annotations"}, _annotations),
    ({"people"}, lambda path, value: inspect_predictions(path, "openpose")),
    ({"instance_info"}, lambda path, value: inspect_predictions(path, "mmpose")),
    ({"T_base_mocap"}, _registration),
    ({"intrinsic_matrix"}, _camera),
    ({"width", "height"}, _camera),
]
