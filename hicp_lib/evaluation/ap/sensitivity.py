"""Sensitivity of average precision to the open choices of its definition."""

from collections.abc import Mapping
from dataclasses import asdict
from typing import get_args, get_type_hints

import numpy as np
import pandas as pd

from hicp_lib.core.detections import Detections
from hicp_lib.evaluation.ap.evaluate import evaluate
from hicp_lib.evaluation.ap.options import Options, choose
from hicp_lib.formats.annotations import Annotations


def sensitivity_table(
    annotations: Annotations, detections: Mapping[int, Detections], group: str = "body"
) -> pd.DataFrame:
    """Changes of the metrics when one option at a time is not at its default.

    Parameters
    ----------
    annotations : Annotations
        The truth.
    detections : mapping of int to Detections
        By image id.
    group : str
        A key of `OBJECTS`.

    Returns
    -------
    DataFrame
        Columns `changed` ("default", or e.g. "area=box"), those of `Evaluation.row`, and `AP_change` from the
        default. Options that the annotations do not support are left out: area "source", points outside.
    """
    counted = np.flatnonzero(~annotations.is_crowd)
    missing = set() if all("source_area" in annotations.extras[i] for i in counted) else {("area", "source")}
    missing |= set() if (annotations.visibility < 0).any() else {("outside", "count")}
    variants: dict[str, dict[str, str]] = {"default": {}}
    default = asdict(choose(group, {})[1])
    for name, kind in get_type_hints(Options).items():
        values = [v for v in get_args(kind) if v != default[name] and (name, v) not in missing]
        variants |= {f"{name}={value}": {name: value} for value in values}
    cases = ((changed, evaluate(annotations, detections, group, **way)) for changed, way in variants.items())
    table = pd.DataFrame({"changed": changed, **its.row()} for changed, its in cases)
    return table.assign(AP_change=table["AP"] - table["AP"].iloc[0])
