"""MMPose's prediction folders: the inferencer's (`pred_out_dir`), and the demos' (`--save-predictions`).

- The inferencer writes `<name>.json` for each image; the demos `results_<name>.json`, the same people as
  `instance_info` beside `meta_info`, whose names of keypoints say which they are.
- A file is a list of people: `keypoints` [[x, y], ...], `keypoint_scores`, and from top-down models `bbox`
  [[x1, y1, x2, y2]] (a list of one) and `bbox_score`.
- Keypoint scores are the decoder's maxima: about 0 to 1 for heat maps, RTMPose and DWPose, up to about
  10 for RTMW. A keypoint whose score is not positive has no place, its coordinates mean nothing.
- The person's score is the one MMPose's own COCO evaluation uses: box score x mean of the keypoint
  scores above 0.2.

Sources: MMPose's inferencer, `split_instances`, and `CocoMetric` ("bbox_keypoint").
"""

from collections import Counter
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np

from hicp_lib.core.errors import InputError
from hicp_lib.core.files import read_json
from hicp_lib.core.keypoints import N_KEYPOINTS
from hicp_lib.formats.importers.people import FileRows, People, json_files, split
from hicp_lib.formats.json_validation import BY_NUMBER, CONVENTIONS, Rows, shown
from hicp_lib.formats.layouts import layouts_of

_KNOWN_KEYS = {"keypoints", "keypoint_scores", "bbox"}
_COUNTED_FROM = 0.2
_SAVED = "results_"  # what --save-predictions puts before an image's name


def read_mmpose(path: Path) -> People:
    """Read the folder MMPoseInferencer wrote with `pred_out_dir`.

    Parameters
    ----------
    path : Path
        The folder.

    Returns
    -------
    People

    Raises
    ------
    InputError
        For anything malformed, and for predictions of a video.
    """
    files = json_files(path, (".json",), "the folder MMPoseInferencer wrote with pred_out_dir")
    read = {file: _instances(file) for file in files.values()}
    sources = [name.removeprefix(_SAVED) if read[file][1] else name for name, file in files.items()]
    rows, source_of = FileRows.joined(path, "instances", {file: people for file, (people, _) in read.items()})
    triples, conventions = _triples(rows)
    keypoints, scores = split(triples, triples[..., 2] > 0)
    counted = scores > _COUNTED_FROM
    means = np.where(counted, scores, 0.0).sum(axis=1) / np.maximum(counted.sum(axis=1), 1)
    return People(
        path, "stem", sources, source_of, keypoints, scores,
        rows.numbers("bbox_score", default=1.0) * means,  # 1 where a bottom-up model gave no box
        conventions, _extras(rows),
    )  # fmt: skip


def _instances(file: Path) -> tuple[list[dict], bool]:
    """Who is in a file, and whether a demo wrote it."""
    data = read_json(file)
    saved = isinstance(data, dict) and "instance_info" in data
    rows = Rows.of(file, "instances", data["instance_info"] if saved else data).rows
    if rows and "instances" in rows[0]:
        raise InputError(f"{file}: holds the frames of a video; run MMPose on the images, one file each")
    meta = data.get("meta_info") if saved else None
    named = meta.get("keypoint_id2name") if isinstance(meta, dict) else None
    if isinstance(named, dict) and named:
        rows = _in_halpe_order(file, rows, [str(named.get(str(i))) for i in range(len(named))])
    return rows, saved


def _in_halpe_order(file: Path, rows: list[dict], names: list[str]) -> list[dict]:
    """People whose keypoints have names; as they are where they come as their number says."""
    n, indices = len(names), layouts_of(f"{file}: meta_info: keypoint_id2name", names)[0][len(names)]
    if np.array_equal(indices, BY_NUMBER.get(n, [])):
        return rows
    ordered = []
    for k, row in enumerate(rows):
        points, scores = [[0.0, 0.0]] * N_KEYPOINTS, [0.0] * N_KEYPOINTS
        for key, of in (("keypoints", points), ("keypoint_scores", scores)):
            if not isinstance(row.get(key), list) or len(row[key]) != n:
                problem = f"{key} is {shown(row.get(key))}; expected one per name, {n}"
                raise InputError(f"{file}: instances[{k}]: {problem}")
            for i, value in zip(indices.tolist(), row[key], strict=True):
                if i >= 0:
                    of[i] = value
        ordered.append(row | {"keypoints": points, "keypoint_scores": scores})
    return ordered


def _triples(rows: FileRows) -> tuple[np.ndarray, Counter[str]]:
    scores = rows.column("keypoint_scores")
    points = rows.column("keypoints", _is_points, "one [x, y] per keypoint")
    flat = {i: _flat(rows, i, *both) for i, both in enumerate(zip(points, scores, strict=True))}
    positions, conventions = rows.points("keypoints", flat, CONVENTIONS, width=2)
    values, _ = rows.points("keypoint_scores", dict(enumerate(scores)), CONVENTIONS, width=1)
    return np.concatenate([positions, values], axis=-1), conventions


def _is_points(value: Any) -> bool:
    return isinstance(value, list) and set(map(type, value)) == {list} and set(map(len, value)) == {2}


def _flat(rows: FileRows, i: int, points: list, scores: Any) -> list:
    """One person's [[x, y], ...] as a flat list, once the number of them and of the scores is right."""
    if len(points) not in CONVENTIONS:
        counts = ", ".join(map(str, CONVENTIONS))
        raise rows.error(i, f"keypoints has {len(points)} points; expected a whole person's {counts}")
    if not isinstance(scores, list) or len(scores) != len(points):
        raise rows.error(i, f"keypoint_scores is {shown(scores)}; expected {len(points)} numbers")
    return list(chain.from_iterable(points))


def _extras(rows: FileRows) -> list[dict]:
    """What else is written, the box as COCO has it."""
    extras = rows.extras(_KNOWN_KEYS)
    for i, row in enumerate(rows.rows):
        if "bbox" in row:
            x1, y1, x2, y2 = _corners(rows, i, row["bbox"])
            extras[i]["bbox"] = [x1, y1, x2 - x1, y2 - y1]
    return extras


def _corners(rows: FileRows, i: int, box: Any) -> list[float]:
    if isinstance(box, list) and len(box) == 1:
        box = box[0]
    if not isinstance(box, list) or len(box) != 4:
        raise rows.error(i, f"bbox is {shown(box)}; expected [[x1, y1, x2, y2]]")
    return rows.finite([box], 4, lambda j: f"bbox[{j}]", [i])[0].tolist()
