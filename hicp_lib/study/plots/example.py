"""One person as detectors see them."""

from collections.abc import Mapping
from pathlib import Path

import pandas as pd

from hicp_lib.core.detections import Detections
from hicp_lib.core.images import read_image
from hicp_lib.formats.annotations import Annotations
from hicp_lib.study.plots.people import draw_detections, draw_truth, picture_grid
from hicp_lib.study.plots.style import WIDTH_IN, Figure, texts

_MIN_SCORE = 0.1  # of keypoints that are drawn


def example(
    images_dir: Path,
    people: Annotations,
    image_id: int,
    found: Mapping[str, Mapping[int, Detections]],
    oks: pd.DataFrame,
    note: str,
) -> Figure:
    """One person, annotated and as each detector sees them, with the OKS of the best detection.

    Parameters
    ----------
    images_dir : Path
        Folder of the images.
    people : Annotations
        The truth.
    image_id : int
        Which image.
    found : mapping of str to mapping of int to Detections
        By detector, then by image id.
    oks : pd.DataFrame
        As from `metric_table.people_oks`, of these people.
    note : str
        What the data are, for the caption.
    """
    image = read_image(images_dir / people.images[image_id].file_name)
    own = (people.image_ids == image_id) & ~people.is_crowd
    cells = {"annotated": draw_truth(people, images_dir, image_id, own, "#FFFFFF")}
    bodies = oks[(oks["group"] == "body") & (oks["image_id"] == image_id)].set_index("detector")["oks"]
    for name, run in found.items():
        seen = run.get(image_id, Detections.none())
        words = "nothing found" if not len(seen) else f"OKS {bodies[name]:.2f}" if name in bodies else "found"
        cells[f"{name}\n{words}"] = draw_detections(image, seen, name, _MIN_SCORE)
    rows = [list(cells.values())[start : start + 3] for start in range(0, len(cells), 3)]
    said = [title.replace("\n", ": ") for title in cells][1:]
    told = texts("example", note=note, said=said, min_score=_MIN_SCORE)
    grid = picture_grid(rows, *told, titles=list(cells), cell_in=WIDTH_IN / 3)
    for axis in grid.figure.axes:
        axis.title.set_fontsize(9)
    return grid
