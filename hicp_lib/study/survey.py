"""The survey of data sets and detectors (the paper's Tables I and II, `data/survey.json`)."""

from collections.abc import Collection

import pandas as pd

from hicp_lib.core.datafiles import DATA_DIR
from hicp_lib.core.files import read_json
from hicp_lib.detectors.registry import DETECTORS, command_to_run, command_to_use

_SURVEY_FILE = DATA_DIR / "survey.json"


def surveyed_data_sets() -> pd.DataFrame:
    """Data sets with annotated keypoints, one row each; numbers are points per person."""
    return pd.DataFrame(read_json(_SURVEY_FILE)["data_sets"]).drop(columns="reference")


def surveyed_detectors(run: Collection[str]) -> pd.DataFrame:
    """Detectors (the paper's Table II), one row each, with a column `here`: "run", or what would run it.

    Parameters
    ----------
    run : sequence of str
        Names of the detectors that were run; one that was imported as NAME-imported counts.

    Examples
    --------
    >>> table = surveyed_detectors(["mediapipe", "mmpose-imported"]).set_index("detector")
    >>> table.at["mediapipe", "here"], table.at["mmpose", "here"]
    ('run', 'run')
    """
    table = pd.DataFrame(read_json(_SURVEY_FILE)["detectors"]).drop(columns="reference")
    return table.assign(here=[_status(name, run) for name in table["detector"]])


def _status(name: str, run: Collection[str]) -> str:
    if name in run or f"{name}-imported" in run:
        return "run"
    if name in ("mediapipe-pose", "mediapipe-hands") and "mediapipe" in run:
        return "run, within mediapipe"
    if name in DETECTORS:
        command = command_to_use if DETECTORS[name].needs_model else command_to_run
        return f"not run; {command(name)}"
    return f"not run; hicp import --format {name} --predictions DIR --annotations A.json --out D.json"
