"""The usual way: pycocotools, fed with plain dictionaries. What our numbers are held against."""

import contextlib
import io

import numpy as np
from pycocotools.coco import COCO
from pycocotools.cocoeval import COCOeval

from hicp_lib.core.keypoints import GROUPS, SIGMAS


def run_pycocotools(annotations, detections, group) -> COCOeval:
    """Evaluated, accumulated and summarised; it prints, but not here."""
    points = GROUPS[group]
    truth, results = COCO(), []
    rows = [
        {"id": i + 1, "image_id": int(annotations.image_ids[i]), "category_id": 1,
         "area": annotations.areas_px2[i], "bbox": annotations.boxes_px[i].tolist(),
         "iscrowd": int(annotations.is_crowd[i]),
         "num_keypoints": int((annotations.visibility[i, points] > 0).sum()),
         "keypoints": np.nan_to_num(np.column_stack(
             [annotations.keypoints_px[i, points], annotations.visibility[i, points]])).ravel().tolist()}
        for i in range(len(annotations))
    ]  # fmt: skip
    for image_id, found in detections.items():
        for person, score in zip(found.keypoints_px[:, points], found.person_scores, strict=True):
            # What is not given lies far off: of NaN pycocotools makes a perfect match.
            flat = np.concatenate([np.nan_to_num(person, nan=-1e12), np.ones((len(points), 1))], axis=1)
            results.append(
                {
                    "image_id": image_id,
                    "category_id": 1,
                    "keypoints": flat.ravel().tolist(),
                    "score": float(score),
                }
            )
    truth.dataset = {"images": [{"id": i} for i in annotations.images], "annotations": rows,
                     "categories": [{"id": 1}]}  # fmt: skip
    with contextlib.redirect_stdout(io.StringIO()):
        truth.createIndex()
        run = COCOeval(truth, truth.loadRes(results) if results else COCO(), "keypoints")
        run.params.kpt_oks_sigmas = SIGMAS["halpe"][points]
        run.params.areaRng[0] = [0.0, np.inf]  # "all" ends at 1e10, and a keypoint far off makes a large area
        run.evaluate()
        run.accumulate()
        run.summarize()
    return run


def figures(run: COCOeval) -> dict[str, float]:
    """AP and AR over all areas, by our names."""
    names = ("AP", "AP50", "AP75", "AR", "AR50", "AR75")
    return dict(zip(names, run.stats[[0, 1, 2, 5, 6, 7]].tolist(), strict=True))
