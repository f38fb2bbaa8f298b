"""Calibrations as files: fitted to one result file, applied to others of the same detector.

The table is the one the report saves: columns `detector, group, score, rate`, a row per corner of a curve
(`hicp_lib.evaluation.calibration.curves.calibration_table`), as Parquet there and as CSV here.
"""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pandas as pd

from hicp_lib.core.detections import Detections
from hicp_lib.core.errors import InputError
from hicp_lib.core.files import write_bytes
from hicp_lib.core.keypoints import GROUPS
from hicp_lib.core.tables import read_table
from hicp_lib.evaluation.calibration.curves import Calibration, calibration_table, calibrations_of
from hicp_lib.evaluation.calibration.keypoint_hits import keypoint_hits
from hicp_lib.formats.annotations import Annotations
from hicp_lib.formats.detection_files import CALIBRATED, RAW_SCORES, refuse_other_suffix
from hicp_lib.formats.detections import read_detections, write_detections

_ROUNDING = 1e-12  # by which a rate may decrease
_COLUMNS = ["detector", "group", "score", "rate"]


def fit_calibrations(
    annotations: Annotations, detections: Mapping[int, Detections], detector: str
) -> tuple[pd.DataFrame, dict[str, int]]:
    """Fit a calibration for every group of keypoints in the detections that the annotations label.

    It uses all annotated images: do not evaluate calibrated scores on the same ones.

    Parameters
    ----------
    annotations : Annotations
        The truth.
    detections : mapping of int to Detections
        By image id.
    detector : str
        Its name, for the table.

    Returns
    -------
    table : DataFrame
        As of `hicp_lib.evaluation.calibration.curves.calibration_table`.
    counts : dict of str to int
        By group, the number of keypoints used for the fit; 0 for a group that was detected, but not labelled.

    Raises
    ------
    InputError
        If the detector has no name, or no group that was detected is labelled.
    """
    if not detector:
        raise InputError("the detector's name is empty; give one")
    labelled = (annotations.visibility[~annotations.is_crowd & ~annotations.is_other] > 0).any(axis=0)
    calibrations, counts = {}, {}
    for group in GROUPS:
        hits = keypoint_hits(annotations, detections, group)
        if len(hits):
            counts[group] = len(hits) if labelled[GROUPS[group]].any() else 0
        if counts.get(group):
            fitted = Calibration.fit(hits["score"].to_numpy(), hits["hit"].to_numpy())
            calibrations[detector, group] = fitted
    if not calibrations:
        raise InputError("no scored keypoints of labelled people; give more images to calibrate on")
    return calibration_table(calibrations), counts


def write_calibrations(path: str | Path, table: pd.DataFrame) -> None:
    """Write a calibration table as CSV, every digit of it; `InputError` for the name of another format."""
    refuse_other_suffix(path, [".csv"])
    write_bytes(path, table.to_csv(index=False).encode())


def read_calibrations(path: str | Path, detector: str | None = None) -> dict[str, Calibration]:
    """Read the calibrations of one detector.

    Parameters
    ----------
    path : str or Path
        CSV, or Parquet where the name ends in `.parquet`.
    detector : str, optional
        Its name; may be left out if the file has only one.

    Returns
    -------
    dict of str to Calibration
        By group.

    Raises
    ------
    InputError
        If the file is unreadable, is not a table of calibrations, or the detector is ambiguous.
    """
    path = Path(path)
    table = read_table(path, _COLUMNS, dtype={"detector": str, "group": str}, keep_default_na=False)
    table["detector"] = table["detector"].fillna("").astype(str)
    for row in np.flatnonzero(table["detector"] == "")[:1]:
        raise InputError(f"{path}: row {row + 1} has no detector; expected its name")
    names = table["detector"].unique().tolist()
    if detector is None and len(names) == 1:
        detector = names[0]
    if detector not in names:
        asked = "no detector is named" if detector is None else f"detector {detector!r} is not in it"
        raise InputError(f"{path}: {asked}; expected one of: {', '.join(names) or 'none'}")
    rows = table[table["detector"] == detector]
    rows = rows.assign(**{key: pd.to_numeric(rows[key], errors="coerce") for key in ("score", "rate")})
    _check(path, rows)
    return {group: calibration for (_, group), calibration in calibrations_of(rows).items()}


def _check(path: Path, table: pd.DataFrame) -> None:
    unknown = set(table["group"]) - GROUPS.keys()
    if unknown:
        raise InputError(f"{path}: group {unknown.pop()!r} is not known; expected {', '.join(GROUPS)}")
    for group, rows in table.groupby("group"):
        values = rows[["score", "rate"]].to_numpy(float)
        rates, steps = values[:, 1], np.diff(values, axis=0)
        proper = np.isfinite(values).all() and ((rates >= 0) & (rates <= 1)).all()
        if not (proper and (steps > (0, -_ROUNDING)).all()):
            raise InputError(f"{path}: group {group}: expected rising scores, rates that do not fall")


def apply_calibrations(
    detections_path: str | Path, calibrations: Mapping[str, Calibration], out: str | Path
) -> int:
    """Write a result file with calibrated keypoint scores, keeping the original ones.

    An importer's `raw_keypoint_scores` are kept. Keypoints of groups without a calibration keep their scores,
    and so do people: AP ranks people and does not change.

    Parameters
    ----------
    detections_path : str or Path
        The result file to calibrate.
    calibrations : mapping of str to Calibration
        By group.
    out : str or Path
        The result file to write.

    Returns
    -------
    int
        The people in it.

    Raises
    ------
    InputError
        As `hicp_lib.formats.detections.read_detections`; if it is calibrated already.
    """
    extras: dict[int, list[dict]] = {}
    found = read_detections(detections_path, extras=extras)
    for image_id, people in extras.items():
        if any(extra.get(CALIBRATED) for extra in people):
            problem = f"the keypoint scores of image {image_id} are calibrated already"
            raise InputError(f"{detections_path}: {problem}; give the detector's own results")
        raw = found[image_id].scores.tolist()
        pairs = zip(raw, people, strict=True)
        extras[image_id] = [{RAW_SCORES: scores} | extra | {CALIBRATED: True} for scores, extra in pairs]
    for group, calibration in calibrations.items():
        found = {image_id: calibration.apply(people, group) for image_id, people in found.items()}
    write_detections(out, found, extras)
    return sum(map(len, found.values()))
