"""The same person with and without the head, as every detector sees them: the picture of the front page."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import pandas as pd

from hicp_lib.core.detections import Detections
from hicp_lib.core.images import read_image
from hicp_lib.formats.annotations import Annotations
from hicp_lib.study.plots.people import detections_grid
from hicp_lib.study.plots.style import Figure, in_style, series_text, texts

_ROWS = {"basic": "whole", "headless": "head cut off"}
_MIN_SCORE = 0.1
_TEXT_PT = 1.75  # per inch of the figure's width: legible on a phone, too


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
    of_bodies = oks[oks["group"] == "body"].groupby(["image_id", "detector", "subset"], sort=False)["oks"]
    return _drawn(of_bodies.max().unstack().reindex(columns=[*_ROWS]).dropna(), folders, truth, found, note)


@in_style
def _drawn(oks: pd.DataFrame, folders, truth, found, note: str) -> Figure:
    """`oks` by image id and detector, a column per subset; the rest as for `same_person`."""
    losses = (oks["basic"] - oks["headless"]).groupby("image_id").mean().sort_values(kind="stable")
    shown = losses.index[len(losses) // 2]
    of_shown = oks.loc[shown]
    pictures, said = {}, []
    for subset, row in _ROWS.items():
        image = read_image(Path(folders[subset]) / "images" / truth[subset].images[shown].file_name)
        seen = {name: found[subset, name].get(shown, Detections.none()) for name in of_shown.index}
        pictures[row] = image, seen
        said.append(f"{row}, {series_text(of_shown[subset])}")
    titles = [f"{name}\nOKS {value:.2f}" for name, value in of_shown["basic"].items()]
    titles += [f"OKS {value:.2f}" for value in of_shown["headless"]]
    figure = detections_grid(pictures, _MIN_SCORE)
    size_pt = _TEXT_PT * figure.figure.get_figwidth()
    for axis, title in zip(figure.figure.axes, titles, strict=True):
        axis.set_title(title.replace("-", "-\n"), fontsize=size_pt, loc="center")
        axis.yaxis.label.set_fontsize(size_pt)
    caption, alt = texts("same_person", min_score=_MIN_SCORE, n=len(losses), said="; ".join(said), note=note)
    return replace(figure, caption=caption, alt=alt)
