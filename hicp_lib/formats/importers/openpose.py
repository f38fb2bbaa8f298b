"""OpenPose's `--write_json` folders, and those of other tools in its style: a file for each image.

- A file is named `<name>_keypoints.json`, or if there are none, `<name>.json`.
- The body has 25 parts (BODY_25) or 18 (COCO), distinguished by the length of its list; the face has 70, each
  hand 21. Other tools write 17 (COCO), 26 or 136 (Halpe) and 133 (COCO-WholeBody) in OpenPose's style,
  including face and hands. An empty list, or null, means that this part of the model was not run; a keypoint
  with confidence 0 was not found.
- Coordinates are read as source pixels (`--keypoint_scale 0`, OpenPose's default) and refused otherwise.
- OpenPose itself adds half a pixel to the body's peaks, not to those of face and hands; it is subtracted, so
  that pixel centres are at integers. A file with a text as `version`, as from AlphaPose, is not OpenPose's.
- No score of the person is written (OpenPose's own averages parts and limbs, and limbs are not in the
  file). Here it is the sum fraction of the body parts' confidences over the number of parts, absent ones 0;
  without a body, the mean confidence of the keypoints found.

Source: OpenPose's output documentation.
"""

from collections import Counter
from pathlib import Path

import numpy as np

from hicp_lib.core.errors import InputError
from hicp_lib.core.files import read_json
from hicp_lib.core.keypoints import BODY, N_KEYPOINTS, TO_HALPE
from hicp_lib.core.progress import with_bar
from hicp_lib.formats.importers.people import FileRows, People, json_files, split
from hicp_lib.formats.importers.results import OPENPOSE, read_results
from hicp_lib.formats.json_validation import CONVENTIONS, Rows

_ENDINGS = ("_keypoints.json", ".json")
_BODY = "pose_keypoints_2d"
# Key -> what its list may be, by length.
_PARTS = {
    _BODY: {75: "openpose_body25", 54: "openpose_coco18"} | {3 * n: name for n, name in CONVENTIONS.items()},
    "face_keypoints_2d": {210: "openpose_face70"},
    "hand_left_keypoints_2d": {63: "left_hand21"},
    "hand_right_keypoints_2d": {63: "right_hand21"},
}
_RUN_AGAIN = "run OpenPose with --keypoint_scale 0 (source pixels)"
_PADDING = 0.05  # of an image's side: padding to the network's input may leave a few just beyond the edge
_MOST_OUTSIDE = 0.1  # fraction of the body parts


def read_openpose(path: Path) -> People:
    """Read a `--write_json` folder, or a `--write_coco_json` file.

    Parameters
    ----------
    path : Path
        The folder, or the file.

    Returns
    -------
    People

    Raises
    ------
    InputError
        For anything malformed, and for coordinates that are not pixels.
    """
    if path.is_file():
        return read_results(path, OPENPOSE)
    files = json_files(path, _ENDINGS, "the folder OpenPose wrote with --write_json")
    read = {file: _people(file) for file in with_bar(files.values(), "reading", "file")}
    rows, source_of = FileRows.joined(path, "people", {file: people for file, (people, _) in read.items()})
    of_openpose = np.array([own for _, own in read.values()])[source_of]
    triples, conventions, n_parts = _triples(rows, of_openpose)
    keypoints, scores = split(triples, triples[..., 2] > 0)
    parts, n_counted = scores[:, BODY], n_parts
    if not n_parts.any():  # only face or hands were run
        parts, n_counted = scores, (scores > 0).sum(axis=1)
    person_scores = parts.sum(axis=1) / np.maximum(n_counted, 1)
    return People(
        path, "stem", list(files), source_of, keypoints, scores, person_scores, conventions,
        [{} for _ in rows.rows],
    )  # fmt: skip


def _people(file: Path) -> tuple[list[dict], bool]:
    """The people in a file, and whether OpenPose itself may have written it."""
    data = read_json(file)
    data = data or {"people": []} if isinstance(data, list) else data
    if not isinstance(data, dict) or "people" not in data:
        raise InputError(f"{file}: has no 'people'; expected a file of OpenPose's --write_json")
    return Rows.of(file, "people", data["people"]).rows, not isinstance(data.get("version"), str)


def _triples(rows: FileRows, of_openpose: np.ndarray) -> tuple[np.ndarray, Counter[str], np.ndarray]:
    """All parts as (n, 136, 3), people per convention, and the number of the body's parts, shape (n,)."""
    triples, n_parts = np.zeros((len(rows.rows), N_KEYPOINTS, 3)), np.zeros(len(rows.rows))
    conventions: Counter[str] = Counter()
    for key, by_length in _PARTS.items():
        lists = _lists(rows, key, by_length)
        by_number = {length // 3: convention for length, convention in by_length.items()}
        points, found = rows.points(key, dict(lists), by_number)
        if key == _BODY:
            for i, values in lists.items():
                convention = by_length[len(values)]
                n_parts[i] = np.isin(TO_HALPE[convention], BODY).sum()
                if of_openpose[i] and convention.startswith("openpose"):
                    points[i, :, :2] -= OPENPOSE.offset_px * (points[i, :, 2:] > 0)
        conventions += found
        triples = np.where(points[..., 2:] > 0, points, triples)
    return triples, conventions, n_parts


def _lists(rows: FileRows, key: str, by_length: dict[int, str]) -> dict[int, list]:
    """The rows that have this part. Only the body's key must be there."""
    names = ", ".join(f"{length} ({name})" for length, name in by_length.items())
    needed: dict[str, list] = {} if key == _BODY else {"default": []}
    allowed = (0, *by_length)
    expected = f"x, y, c per part: {names}, or 0 numbers"
    values = rows.column(
        key, lambda v: v is None or isinstance(v, list) and len(v) in allowed, expected, **needed
    )
    return {i: value for i, value in enumerate(values) if value}


def refuse_other_size(path: Path, keypoints_px: np.ndarray, sizes_px: np.ndarray) -> None:
    """Refuse coordinates of the network's input or the output image: OpenPose finds no points outside images.

    Parameters
    ----------
    path : Path
        What was read, for the message.
    keypoints_px : array, shape (n, 136, 2)
        Of all people.
    sizes_px : array, shape (n, 2)
        Width and height of each person's image.

    Raises
    ------
    InputError
        If more than a tenth fraction of the body parts lie outside.
    """
    body = keypoints_px[:, BODY]
    given = np.isfinite(body).all(axis=-1)
    outside = given & (body > (1 + _PADDING) * sizes_px[:, None]).any(axis=-1)
    if outside.sum() > _MOST_OUTSIDE * given.sum():
        raise InputError(
            f"{path}: {outside.sum()} of {given.sum()} body parts lie outside their images; "
            f"expected source pixels of the annotated images, {_RUN_AGAIN} on these images"
        )
