"""MMPose's prediction folders: the inferencer's (`pred_out_dir`), and the demos' (`--save-predictions`).

- The inferencer writes `<name>.json` for each image; the demos `results_<name>.json`, with the people in
  `instance_info` and the keypoint names in `meta_info`.
- A file is a list of people: `keypoints` [[x, y], ...], `keypoint_scores`, and from top-down models `bbox`
  [[x1, y1, x2, y2]] (a list of one) and `bbox_score`.
- Keypoint scores are the decoder's maxima: about 0 to 1 for heat maps, RTMPose and DWPose, up to about
  10 for RTMW. A keypoint whose score is not positive is missing; its coordinates have no meaning.
- The person's score is the one MMPose's own COCO evaluation uses: box score x mean of the keypoint
  scores above 0.2.

Sources: MMPose's inferencer, `split_instances`, and `CocoMetric` ("bbox_keypoint").
"""

from dataclasses import replace
from pathlib import Path

import numpy as np

from hicp_lib.core.errors import InputError
from hicp_lib.core.files import read_json
from hicp_lib.core.progress import with_bar
from hicp_lib.formats.importers.people import FileRows, People, json_files, split
from hicp_lib.formats.json_validation import Rows, shown
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
    read = {file: _instances(file) for file in with_bar(files.values(), "reading", "file")}
    named = (n.removeprefix(_SAVED) if read[file][1] is not None else n for n, file in files.items())
    of_models = {names for _, names in read.values() if names}
    if len(of_models) > 1:
        raise InputError(f"{path}: keypoint_id2name differs from file to file; import each model by itself")
    layouts, _ = layouts_of(f"{path}: keypoint_id2name", next(iter(of_models), ()))
    joined, source_of = FileRows.joined(
        path, "instances", {file: people for file, (people, _) in read.items()}
    )
    for key in ("keypoint_scores", "keypoints"):
        joined.column(key)
    rows = replace(joined, rows=[row | {"keypoints": _flat(joined, i)} for i, row in enumerate(joined.rows)])
    triples, conventions = rows.keypoints(layouts)
    keypoints, scores = split(triples, triples[..., 2] > 0)
    counted = scores > _COUNTED_FROM
    means = np.where(counted, scores, 0.0).sum(axis=1) / np.maximum(counted.sum(axis=1), 1)
    return People(
        path, "stem", list[str | int](named), source_of, keypoints, scores,
        rows.numbers("bbox_score", default=1.0) * means,  # 1 if a bottom-up model gave no box
        conventions, _extras(rows),
    )  # fmt: skip


def _instances(file: Path) -> tuple[list[dict], tuple[str, ...] | None]:
    """The people in a file, and for a demo's file the names of their keypoints, if given."""
    data, names = read_json(file), None
    if isinstance(data, dict) and "instance_info" in data:
        meta = data.get("meta_info")
        named = meta.get("keypoint_id2name") if isinstance(meta, dict) else None
        names = tuple(str(named.get(str(i))) for i in range(len(named))) if isinstance(named, dict) else ()
        data = data["instance_info"]
    rows = Rows.of(file, "instances", data).rows
    if rows and "instances" in rows[0]:
        raise InputError(f"{file}: holds the frames of a video; run MMPose on the images, one file each")
    return rows, names


def _flat(rows: FileRows, i: int) -> list:
    """One person's x, y, score of each keypoint as a flat list."""
    points, scores = (rows.rows[i].get(key) for key in ("keypoints", "keypoint_scores"))
    if not isinstance(points, list) or not all(isinstance(xy, list) and len(xy) == 2 for xy in points):
        raise rows.error(i, f"keypoints is {shown(points)}; expected one [x, y] per keypoint")
    if not isinstance(scores, list) or len(scores) != len(points):
        raise rows.error(i, f"keypoint_scores is {shown(scores)}; expected {len(points)} numbers")
    return [value for (x, y), score in zip(points, scores, strict=True) for value in (x, y, score)]


def _extras(rows: FileRows) -> list[dict]:
    """Further keys to keep, with the box in COCO's form."""
    extras = rows.extras(_KNOWN_KEYS)
    for i, box in ((i, row["bbox"]) for i, row in enumerate(rows.rows) if "bbox" in row):
        corners = box[0] if isinstance(box, list) and len(box) == 1 else box
        if not isinstance(corners, list) or len(corners) != 4:
            raise rows.error(i, f"bbox is {shown(corners)}; expected [[x1, y1, x2, y2]]")
        x1, y1, x2, y2 = rows.finite([corners], 4, lambda j: f"bbox[{j}]", [i])[0].tolist()
        extras[i]["bbox"] = [x1, y1, x2 - x1, y2 - y1]
    return extras
