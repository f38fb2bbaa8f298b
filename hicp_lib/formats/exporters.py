"""Detections for other tools: COCO keypoint results, and a COCO data set that FiftyOne opens.

- "coco": a list of `image_id, category_id, keypoints, score`, in any of COCO's and Halpe's layouts.
- "fiftyone": a COCO data set of the images with the detections as its annotations, keypoint names and
  skeleton in its category. FiftyOne shows it over the images with

      fiftyone.Dataset.from_dir(dataset_type=fiftyone.types.COCODetectionDataset, label_types="keypoints",
                                data_path=IMAGES, labels_path=OUT)

  (limbs once the data set's `default_skeleton` is set to the category's), and any reader of COCO
  annotations has names and sizes of the images in it. A keypoint's flag is 2 when it is given; per
  person, `confidence` are the keypoints' scores and `score` is the person's.

Keypoints that are not given are 0, 0, 0 in both. Results keep what was known of their image (`file_name`; of
a video, `frame` and `time_s`).
"""

from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np

from hicp_lib.core.detections import Detections
from hicp_lib.core.errors import InputError, refuse_unknown
from hicp_lib.core.files import write_json
from hicp_lib.core.keypoints import LIMBS, NAMES, TO_HALPE
from hicp_lib.formats.annotations import PERSON, Annotations, image_rows
from hicp_lib.formats.detection_files import FACTS, refuse_other_suffix, result_rows

FORMATS = ("coco", "fiftyone")
LAYOUTS = ("halpe136", "halpe26", "coco17", "wholebody133")


def export_detections(
    format: str, detections: Mapping[int, Detections], out: str | Path, annotations: Annotations | None =
    None, layout: str = "halpe136", extras: Mapping[int, list[dict]] | None = None,
) -> int:  # fmt: skip
    """Write detections for another tool.

    People without any keypoint in the layout are left out.

    Parameters
    ----------
    format : {"coco", "fiftyone"}
        What to write, as the module says.
    detections : mapping of int to Detections
        By image id.
    out : str or Path
        The file to write.
    annotations : Annotations, optional
        Of the images; "fiftyone" needs it for their names and sizes.
    layout : {"halpe136", "halpe26", "coco17", "wholebody133"}
        The keypoints written, and their order.
    extras : mapping of int to list of dict, optional
        As `hicp_lib.formats.detections.read_detections` fills it.

    Returns
    -------
    int
        The number of people written.

    Raises
    ------
    InputError
        For an unknown format or layout, images without name and size, and a file not named `.json`.
    """
    refuse_other_suffix(out, [".json"])
    refuse_unknown("format", format, FORMATS)
    refuse_unknown("layout", layout, LAYOUTS)
    people = list(_people(detections, TO_HALPE[layout], (format == "coco" and extras) or {}))
    if format == "coco":
        write_json(out, people)
    else:
        images = _images(detections, annotations)
        people = [row | {"id": i, "iscrowd": 0, **_as_labelled(row)} for i, row in enumerate(people, start=1)]
        write_json(out, {"images": images, "annotations": people, "categories": [_category(layout)]})
    return len(people)


def _people(
    detections: Mapping[int, Detections], keypoints: np.ndarray, extras: Mapping[int, list[dict]]
) -> Iterator[dict]:
    """One COCO keypoint result after the other."""
    for image_id, found in detections.items():
        facts = [{key: of[key] for key in FACTS if key in of} for of in extras.get(image_id, [])]
        for row in result_rows(int(image_id), {}, found, facts, keypoints):
            if row["keypoints"].any():
                yield row | {"keypoints": row["keypoints"].tolist()}


def _as_labelled(row: dict) -> dict:
    """What an annotation has beyond a result, and its keypoints with flags in place of scores."""
    triples = np.reshape(row["keypoints"], (-1, 3))
    given = (triples != 0).any(axis=1)
    corner = triples[given, :2].min(axis=0)
    size = triples[given, :2].max(axis=0) - corner
    flagged = np.column_stack([triples[:, :2], 2 * given])
    return {
        "keypoints": flagged.ravel().tolist(),
        "num_keypoints": int(given.sum()),
        "confidence": triples[:, 2].tolist(),
        "bbox": [*corner.tolist(), *size.tolist()],
        "area": float(size.prod()),
    }


def _images(detections: Mapping[int, Detections], annotations: Annotations | None) -> list[dict]:
    if annotations is None:
        raise InputError("format 'fiftyone' needs the annotations, for the images' names and sizes")
    unknown = detections.keys() - annotations.images.keys()
    if unknown:
        raise InputError(f"detections of image {min(unknown)}: not among the annotations; give its own")
    return image_rows(annotations)


def _category(layout: str) -> dict:
    """The person, with keypoint names and limbs; COCO counts keypoints from 1."""
    place = {int(halpe): i for i, halpe in enumerate(TO_HALPE[layout], start=1)}
    skeleton = [[place[a], place[b]] for a, b in LIMBS if a in place and b in place]
    return {**PERSON, "keypoints": [NAMES[i] for i in TO_HALPE[layout]], "skeleton": skeleton}
