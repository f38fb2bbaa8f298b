"""The survey of data sets and detectors: the paper's Tables I (`data/survey.json`) and II (the registry)."""

from collections.abc import Collection

import pandas as pd

from hicp_lib.core.datafiles import DATA_DIR
from hicp_lib.core.files import read_json
from hicp_lib.detectors.registry import DETECTORS, command_to_run, command_to_use

PAPER_SYSTEMS = ("openpose", "mmpose", "alphapose", "detectron2", "mediapipe")


def surveyed_data_sets() -> pd.DataFrame:
    """Data sets with annotated keypoints, one row each; numbers are points per person."""
    return pd.DataFrame(read_json(DATA_DIR / "survey.json")["data_sets"])


def surveyed_detectors(run: Collection[str]) -> pd.DataFrame:
    """Detectors (the paper's Table II), one row each, the paper's five first.

    Parameters
    ----------
    run : sequence of str
        Names of the detectors that were run; one that was imported as NAME-imported counts.

    Returns
    -------
    pd.DataFrame
        Columns `system, detector, paradigm, keypoints, training data, tracking, input`, `parameters [M]`,
        `operations [G]` (NaN where the user's weights decide) and `here`: "run", or what would run it.

    Examples
    --------
    >>> table = surveyed_detectors(["mediapipe", "mmpose-imported"]).set_index("detector")
    >>> table.at["mediapipe", "here"], table.at["mmpose", "here"]
    ('run', 'run')
    """
    names = dict.fromkeys([*PAPER_SYSTEMS, *DETECTORS])
    facts = {name: DETECTORS[name].facts for name in names}
    rows = [
        (DETECTORS[name].label, name, f.paradigm, f.keypoints, f.training_data, f.tracking, f.input,
         _scaled(f.n_parameters, 1e6), _scaled(f.n_operations, 1e9), _status(name, run))
        for name, f in facts.items()
    ]  # fmt: skip
    columns = ["system", "detector", "paradigm", "keypoints", "training data", "tracking", "input"]
    return pd.DataFrame(rows, columns=[*columns, "parameters [M]", "operations [G]", "here"])


def _scaled(number: int | None, unit: float) -> float:
    return float("nan") if number is None else number / unit


def _status(name: str, run: Collection[str]) -> str:
    if name in run or f"{name}-imported" in run:
        return "run"
    if name in ("mediapipe-pose", "mediapipe-hands") and "mediapipe" in run:
        return "run, within mediapipe"
    command = command_to_use if DETECTORS[name].needs_model else command_to_run
    return f"not run; {command(name)}"
