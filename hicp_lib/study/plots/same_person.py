"""The same person with and without the head, as every detector sees them: the picture of the front page."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import pandas as pd

from hicp_lib.core.detections import Detections
from hicp_lib.core.images import read_image
from hicp_lib.formats.annotations import Annotations
from hicp_lib.study.plots.people import detections_grid
from hicp_lib.study.plots.style import Figure, in_style, texts

_ROWS = {"basic": "whole", "headless": "head cut off"}
_MIN_SCORE = 0.3
_TEXT_PT = 1.75  # per inch of the figure's width: legible on a phone, too


@in_style
def same_person(
    oks: pd.DataFrame,
    folders: Mapping[str, Path],
    truth: Mapping[str, Annotations],
    found: Mapping[tuple[str, str], Mapping[int, Detections]],
    note: str,
) -> Figure:
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
    bodies = oks[oks["group"] == "body"].groupby(["image_id", "detector", "subset"], sort=False)["oks"].max()
    by_subset = bodies.unstack().reindex(columns=list(_ROWS))
    losses = (by_subset["basic"] - by_subset["headless"]).groupby("image_id").mean().dropna()
    ranked = losses.sort_values(kind="stable").index
    image_id = ranked[len(ranked) // 2] if len(ranked) else min(truth["basic"].images)
    of_person = by_subset.reindex(columns=[s for s in _ROWS if image_id in truth[s].images]).loc[image_id]
    pictures, titles = {}, []
    for subset, values in of_person.items():
        image = read_image(Path(folders[subset]) / "images" / truth[subset].images[image_id].file_name)
        seen = {name: found[subset, name].get(image_id, Detections.none()) for name in values.index}
        told = [f"OKS {values[name]:.2f}" if len(seen[name]) else "nobody found" for name in seen]
        titles += told if titles else [f"{name}\n{text}" for name, text in zip(seen, told, strict=True)]
        pictures[_ROWS[subset]] = image, seen
    said = [
        f"{name} {' and '.join(f'{value:.2f}' for value in row)}" for name, *row in of_person.itertuples()
    ]
    words = texts(
        "same_person", min_score=_MIN_SCORE, n=len(ranked), said=said, rows=list(pictures), note=note
    )
    figure = detections_grid(pictures, _MIN_SCORE)
    size_pt = _TEXT_PT * figure.figure.get_figwidth()
    for axis, title in zip(figure.figure.axes, titles, strict=False):
        axis.set_title(title.replace("-", "-\n"), fontsize=size_pt, loc="center")
        axis.yaxis.label.set_fontsize(size_pt)
    return replace(figure, caption=words[0], alt=words[1])
