"""Evaluate detections by every keypoint group and definition: the results of `hicp evaluate`.

Files come in two forms, by their suffix:

- `.json`: what `judge` returns.
- `.csv`, `.parquet`: a row per definition and metric, with `value`, `low` and `high`; image by image in
  `OUT.by_image.csv` (or `.parquet`).
"""

import math
from collections import Counter
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from hicp_lib.core.detections import Detections
from hicp_lib.core.files import write_json, write_table
from hicp_lib.evaluation.ap.bootstrap import bootstrap_intervals
from hicp_lib.evaluation.ap.evaluate import Evaluator
from hicp_lib.evaluation.ap.options import definitions
from hicp_lib.evaluation.ap.person_oks import PersonOks
from hicp_lib.evaluation.cases import labelled
from hicp_lib.evaluation.statistics.resampling import Draws
from hicp_lib.formats.annotations import Annotations, source_images


def judge(
    people: Annotations, found: Iterable[tuple[np.ndarray, Detections]], groups: Iterable[str],
    by_image: bool, seed: int = 0, **options: str,
) -> dict[str, Any]:  # fmt: skip
    """AP and AR by every definition in `definitions`, with intervals over source images.

    Parameters
    ----------
    people : Annotations
        The truth.
    found : iterable of (array, Detections)
        Image ids and detections, some people at a time, as of `detections_in_parts`.
    groups : iterable of str
        Keys of `hicp_lib.evaluation.ap.options.OBJECTS`.
    by_image : bool
        Whether to add results image by image.
    seed : int, optional
        Of the bootstrap.
    **options : str
        Fields of `hicp_lib.evaluation.ap.options.Options`.

    Returns
    -------
    dict
        Ready for JSON. For the first definition `Evaluation.row`, with `metrics` (`value`, `low` and `high`
        of each) and `seed`; the other definitions as `other_definitions`; and `by_image`, a list of rows of
        `_image_table`. None where there is no value, as for a group that annotations or detections lack.
    """
    ways = [way for group in groups for way in definitions(people, group)]
    evaluators = [Evaluator(people, group, **way, **options) for group, way in ways]
    best = {group: PersonOks(people, group, **options) for group, _ in ways if by_image}
    n_found: Counter[int] = Counter()
    for image_ids, some in found:
        n_found.update(image_ids.tolist())
        for evaluator in evaluators:
            evaluator.add(image_ids, some)
        for of_people in best.values():
            of_people.add(image_ids, some)
    clusters, rows = source_images(people), []  # crops of one image are resampled together
    for evaluation in (evaluator.evaluation() for evaluator in evaluators):
        row, figures = evaluation.row(), bootstrap_intervals(evaluation, Draws(seed=seed), clusters)
        if n_found and not evaluation.n_detections:
            figures = dict.fromkeys(figures, (math.nan,) * 3)
            row |= dict.fromkeys(figures, math.nan)
        metrics = {m: _finite(zip(("value", "low", "high"), of, strict=True)) for m, of in figures.items()}
        rows.append(_finite(row.items()) | {"metrics": metrics, "seed": seed})
    judged = {row["group"] for row in rows if row["AP"] is not None}
    tables = [labelled(of.table(), group=group) for group, of in best.items() if group in judged]
    images = {"by_image": _image_table(pd.concat(tables), people, n_found)} if tables else {}
    return rows[0] | {"other_definitions": rows[1:]} | images


def _finite(row: Iterable[tuple[str, Any]]) -> dict[str, Any]:
    """NaN, without evaluated people, is null in JSON."""
    return {k: None if isinstance(v, float) and not math.isfinite(v) else v for k, v in row}


def _image_table(best: pd.DataFrame, people: Annotations, n_found: Mapping[int, int]) -> list[dict]:
    """How well people are found, image by image, the worst first; images with people of the group only.

    Rows with `group, image_id, file_name, n_people, n_detections, oks, oks_least`: mean and minimum over the
    image's people of their best detection's OKS, 0 without one.
    """
    by_image = best.groupby(["group", "image_id"], sort=False)["oks"]
    table = by_image.agg(n_people="size", oks="mean", oks_least="min").reset_index()
    ids = table["image_id"].tolist()
    table.insert(2, "file_name", [people.images[i].file_name for i in ids])
    table.insert(4, "n_detections", [n_found.get(i, 0) for i in ids])
    return table.sort_values(["group", "oks"], kind="stable").to_dict("records")


def write_judgement(path: Path, judged: dict[str, Any]) -> None:
    """Write the results in the format of the file's suffix, as described in this module.

    Parameters
    ----------
    path : Path
    judged : dict
        From `judge`.
    """
    if path.suffix == ".json":
        write_json(path, judged, indent=2)
        return
    shared = [key for key, of in judged.items() if not isinstance(of, dict | list)]
    shared = [key for key in shared if key not in judged["metrics"]]
    of_all = [
        {key: row[key] for key in shared} | {"metric": name, **figure}
        for row in (judged, *judged["other_definitions"])
        for name, figure in row["metrics"].items()
    ]
    write_table(path, pd.DataFrame(of_all))
    if "by_image" in judged:
        write_table(path.with_suffix(f".by_image{path.suffix}"), pd.DataFrame(judged["by_image"]))
