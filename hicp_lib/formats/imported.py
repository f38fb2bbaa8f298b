"""Detections made elsewhere, for comparison with the detectors that are run here."""

import re
from collections.abc import Mapping
from pathlib import Path

from hicp_lib.core.detections import Detections
from hicp_lib.core.errors import InputError
from hicp_lib.core.folders import listed
from hicp_lib.formats.annotations import Annotations
from hicp_lib.formats.detections import read_detections

_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._+-]{0,39}")


def read_imported(
    folder: str | Path, truth: Mapping[str, Annotations]
) -> dict[tuple[str, str], dict[int, Detections]]:
    """Detections by (subset, "NAME-imported"), as `hicp_lib.evaluation.ap.metric_table` takes them.

    The suffix distinguishes them from a detector of that name which is run here.

    Parameters
    ----------
    folder : str or Path
        Contains a folder per detector, named after it, with a file of detections for each subset:
        `mmpose/basic.json`, `mmpose/headless.json`, ..., as `hicp import` and `hicp detect` write them; an
        empty text for none.
    truth : mapping of str to Annotations
        By subset.

    Returns
    -------
    dict of (str, str) to dict of int to Detections
        By image id, of every subset and detector.

    Raises
    ------
    InputError
        For a folder without such folders, invalid names, and files that are missing or do not fit.
    """
    if not folder:
        return {}
    detectors = [path for name in sorted(listed(folder)) if (path := Path(folder, name)).is_dir()]
    if not detectors:
        raise InputError(f"{folder}: holds no folder; expected one per detector, such as mmpose/basic.json")
    for path in detectors:
        if not _NAME.fullmatch(path.name):
            raise InputError(f"{path}: the folder's name is the detector's; use letters, digits, - and _")
    return {
        (subset, f"{path.name}-imported"): read_detections(path / f"{subset}.json", people)
        for subset, people in truth.items()
        for path in detectors
    }
