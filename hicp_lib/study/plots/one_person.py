"""One person as detectors see them: an example, and the same person with and without the head."""

from collections.abc import Mapping
from pathlib import Path

import pandas as pd

from hicp_lib.core.detections import Detections
from hicp_lib.core.images import read_image
from hicp_lib.formats.annotations import Annotations
from hicp_lib.study.plots.people import draw_detections, draw_truth, picture_grid
from hicp_lib.study.plots.style import COLUMN_IN, WIDTH_IN, Figure, in_style, series_text, texts

_MIN_SCORE = 0.1  # of keypoints that are drawn
_ROWS = {"basic": "whole", "headless": "head cut off"}
_TEXT_PT = 1.75  # per inch of the figure's width: legible on a phone, too


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
    return picture_grid(rows, *told, titles=list(cells), cell_in=WIDTH_IN / 3, title_pt=9)


@in_style
def same_person(
    oks: pd.DataFrame,
    folders: Mapping[str, Path],
    truth: Mapping[str, Annotations],
    found: Mapping[tuple[str, str], Mapping[int, Detections]],
    note: str,
) -> Figure | None:
    """The person whose loss of OKS without the head, mean over detectors, is the median of all people.

    Parameters
    ----------
    oks : pd.DataFrame
        From `people_oks`.
    folders : mapping of str to Path
        Subset -> dataset folder.
    truth : mapping of str to Annotations
        By subset.
    found : mapping of (str, str) to mapping of int to Detections
        By subset and detector, then by image id.
    note : str
        What the data are, for the caption.
    """
    of_bodies = oks[oks["group"] == "body"].groupby(["image_id", "detector", "subset"], sort=False)["oks"]
    both = of_bodies.max().unstack().reindex(columns=[*_ROWS]).dropna()
    if both.empty:
        return None
    losses = (both["basic"] - both["headless"]).groupby("image_id").mean().sort_values(kind="stable")
    shown = losses.index[len(losses) // 2]
    of_shown = both.loc[shown]
    rows, titles, said = [], [], []
    for subset, row in _ROWS.items():
        image = read_image(Path(folders[subset]) / "images" / truth[subset].images[shown].file_name)
        seen = {name: found[subset, name].get(shown, Detections.none()) for name in of_shown.index}
        rows.append([draw_detections(image, people, name, _MIN_SCORE) for name, people in seen.items()])
        above = {name: name.replace("-", "-\n") + "\n" if subset == "basic" else "" for name in seen}
        titles += [f"{above[name]}OKS {value:.2f}" for name, value in of_shown[subset].items()]
        said.append(f"{row}, {series_text(of_shown[subset])}")
    told = texts("same_person", min_score=_MIN_SCORE, n=len(losses), said="; ".join(said), note=note)
    grid = {"row_titles": [*_ROWS.values()], "titles": titles, "title_pt": _TEXT_PT * COLUMN_IN}
    return picture_grid(rows, *told, **grid, cell_in=COLUMN_IN / max(len(of_shown), 2))
