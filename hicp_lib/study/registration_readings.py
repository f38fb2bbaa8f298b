"""Which assumption of the paper's registration costs what: one changed at a time, over many draws of clicks.

The paper clicks eight markers in two images (section IV-C). Which ones, and how rotation and translation
were put together, it leaves open.
"""

from dataclasses import replace
from itertools import combinations

import numpy as np
import pandas as pd

from hicp_lib.core.camera import transform
from hicp_lib.evaluation.space.registration_error import compare_registrations
from hicp_lib.evaluation.statistics.resampling import PERCENTILES
from hicp_lib.mocap import registration as r
from hicp_lib.recordings.qualisys import MotionCapture
from hicp_lib.recordings.recording import Recording
from hicp_lib.study.mocap import simulated_clicks

_NEAR_M = 0.003  # the radius of the paper's other neighbourhood
_EVERY = 50  # measurements of the markers that are judged
_CLICK = ["frame", "marker"]


def registration_readings(
    recording: Recording,
    mocap: MotionCapture,
    offset_s: float,
    n_images: int = 12,
    noise_px: float = 1.0,
    n_draws: int = 100,
    seed: int = 0,
) -> pd.DataFrame | None:
    """Error of `hicp_lib.mocap.registration.register_by_camera_marker` under each reading of the paper.

    Parameters
    ----------
    recording : Recording
    mocap : MotionCapture
        With a marker on the camera.
    offset_s : float
        Of the motion capture's clock.
    n_images : int
    noise_px : float
        Of the simulated clicks, as of `hicp_lib.study.mocap.register`.
    n_draws : int
        How often two of the images, and eight markers clicked in them, are drawn; the same for every reading.
    seed : int
        Of clicks and draws.

    Returns
    -------
    pd.DataFrame or None
        Columns `reading, turned_rad` (median angle to the true rotation), `added_m, low_m, high_m` (median
        displacement of the person's markers: median and 95 % range of the draws), `n_draws`; None where the
        recording is not simulated.

    Raises
    ------
    InputError
        If fewer than three clicks have a depth, or the camera has no marker.
    """
    clicks, exact = simulated_clicks(recording, mocap, n_images, noise_px, seed)
    if exact is None:
        return None
    base = r.lift_clicks(recording, clicks, mocap, offset_s)
    sharp, _ = simulated_clicks(recording, mocap, n_images, 0.0, seed)
    sharp = r.lift_clicks(recording, sharp, mocap, offset_s)
    near = r.lift_clicks(recording, clicks, mocap, offset_s, _NEAR_M)
    true = base.assign(**dict(zip(r.SEEN, transform(exact, base[r.MEASURED].to_numpy()).T, strict=True)))
    marker_m, centre_m = r.camera_places(recording, mocap, offset_s)
    centred_m = transform(np.linalg.inv(exact), centre_m)
    readings = {
        "as written": (base, marker_m, False),
        "camera marker at the optical centre": (base, centred_m, False),
        "clicks without error": (sharp, marker_m, False),
        "depth from 3 mm around a click": (near, marker_m, False),
        "depth of the marker itself": (true, marker_m, False),
        "turned about the camera": (base, marker_m, True),
        "turned about the camera, its marker at the optical centre": (base, centred_m, True),
    }
    tables, found = _in_common([table for table, _, _ in readings.values()]), []
    for eight in _draw_eights(tables[0]["frame"].to_numpy(), n_draws, seed):
        for table, (name, (_, at_m, about_camera)) in zip(tables, readings.items(), strict=True):
            fit = r.register_by_camera_marker(table.iloc[eight], at_m, centre_m, about_camera)
            found.append(replace(fit, method=name))
    some = replace(mocap, times_s=mocap.times_s[::_EVERY], points_m=mocap.points_m[::_EVERY])
    table = compare_registrations(found, some, exact).rename(columns={"method": "reading"})
    of_reading = table.groupby("reading", sort=False)
    low_m, high_m = (of_reading["added_m"].quantile(percent / 100) for percent in PERCENTILES)
    medians = of_reading[["turned_rad", "added_m"]].median()
    return medians.assign(low_m=low_m, high_m=high_m, n_draws=n_draws).reset_index()


def _in_common(tables: list[pd.DataFrame]) -> list[pd.DataFrame]:
    """The clicks that all tables have with a depth of the person, in one order."""
    common = tables[0][_CLICK]
    for table in tables:
        common = common.merge(table.loc[r.keeps_distances(table), _CLICK])
    return [common.merge(table) for table in tables]


def _draw_eights(frames: np.ndarray, n_draws: int, seed: int) -> list[np.ndarray]:
    """Rows of eight clicks in two images, for each draw; of fewer, where no two images have so many."""
    in_two = [np.flatnonzero(np.isin(frames, two)) for two in combinations(np.unique(frames), 2)]
    n = min(r.N_PAPER_MARKERS, max(map(len, in_two)))
    enough, rng = [rows for rows in in_two if len(rows) >= n], np.random.default_rng(seed)
    return [rng.permutation(enough[k])[:n] for k in rng.integers(len(enough), size=n_draws)]
