"""The registration of the motion capture test, and interpretations of the paper's.

A simulated recording has the exact transform; clicks are simulated for it. A laboratory's own recording
contains `clicks.csv` (markers clicked in images, see `hicp_lib.mocap.clicking`), or `registration.json` if
the transform is known. The paper clicks eight markers in two images (section IV-C). It leaves open which
ones, and how rotation and translation were combined.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
import pandas as pd

from hicp_lib.core.camera import transform
from hicp_lib.core.errors import InputError
from hicp_lib.evaluation.space.mocap_error import JOINTS, marker_means
from hicp_lib.evaluation.space.registration_error import compare_registrations
from hicp_lib.evaluation.statistics.resampling import PERCENTILES
from hicp_lib.mocap import eight_clicks
from hicp_lib.mocap import registration as r
from hicp_lib.mocap.clicking import CLICKS_FILE, read_clicks
from hicp_lib.mocap.reprojection import register_by_reprojection
from hicp_lib.recordings.qualisys import MotionCapture
from hicp_lib.recordings.recording import Recording, open_recording, read_simulation

_NEAR_M = 0.003  # the radius of the paper's other neighbourhood
_EVERY = 50  # every n-th measurement of the markers is evaluated
_CLICK = ["frame", "marker"]


@dataclass(frozen=True)
class Registered:
    """The registrations of a recording.

    Attributes
    ----------
    recording : Recording
    mocap : MotionCapture
    offset_s : float
        To add to the motion capture's stamps to have them on the camera's clock.
    fits : list of r.Registration
        By eight clicks, by all, then by reprojection, which is the one to use.
    exact : array or None, shape (4, 4)
        The true transform T_base_mocap; None if unknown.
    clicks : pd.DataFrame
        The clicks of the images of the paper's registration; empty if the transform was given.
    """

    recording: Recording
    mocap: MotionCapture
    offset_s: float
    fits: list[r.Registration]
    exact: np.ndarray | None
    clicks: pd.DataFrame

    def reference(self, fit: r.Registration | None = None, joints: Sequence[str] = JOINTS) -> pd.DataFrame:
        """`marker_means` at the camera's times, under one of the fits; by default the one to use."""
        T_base_mocap = (fit or self.fits[-1]).T_base_mocap
        return marker_means(self.mocap, self.recording.times_s - self.offset_s, T_base_mocap, joints)


def register(
    recording: Recording,
    mocap: MotionCapture,
    offset_s: float,
    n_images: int = 12,
    noise_px: float = 1.0,
    seed: int = 0,
) -> Registered:
    """All possible registrations of a recording; clicks beyond the end of a shortened one are not used.

    Parameters
    ----------
    recording : Recording
    mocap : MotionCapture
    offset_s : float
        Of the motion capture's clock, as from `find_clock`.
    n_images : int
        Images with simulated clicks; like the next two, not used for a laboratory's own recording.
    noise_px : float
        Standard deviation of a simulated click in each direction.
    seed : int
        Of the simulated clicks.

    Returns
    -------
    Registered

    Raises
    ------
    InputError
        If the recording has neither clicks nor a registration, or they are malformed.
    """
    clicks, exact = simulated_clicks(recording, mocap, n_images, noise_px, seed)
    clicks_path = recording.folder / CLICKS_FILE
    if exact is None and not clicks_path.is_file():
        return Registered(recording, mocap, offset_s, [_given(recording)], None, pd.DataFrame())
    if exact is None:
        clicks = read_clicks(clicks_path, open_recording(recording.folder), mocap.names)
        clicks = clicks[clicks["frame"] < len(recording)]
    matched = r.lift_clicks(recording, clicks, mocap, offset_s)
    eight = eight_clicks.select_markers(matched)
    fits = [eight_clicks.register_selected(eight), r.register_robustly(matched)]
    fits.append(register_by_reprojection(recording, clicks, mocap, fits[-1], offset_s))
    if r.CAMERA_MARKER in mocap.names:
        places = eight_clicks.camera_places(recording, mocap, offset_s)
        fits = [eight_clicks.register_by_camera_marker(eight, *places, way) for way in (False, True)] + fits
    return Registered(recording, mocap, offset_s, fits, exact, clicks.merge(eight[_CLICK]))


def simulated_clicks(
    recording: Recording, mocap: MotionCapture, n_images: int, noise_px: float, seed: int
) -> tuple[pd.DataFrame, np.ndarray | None]:
    """Clicks in a simulated recording, and its true transform.

    Parameters
    ----------
    recording : Recording
    mocap : MotionCapture
    n_images : int
    noise_px : float
    seed : int
        These three as of `register`.

    Returns
    -------
    pd.DataFrame
        As from `hicp_lib.simulation.sensors.clicks.simulate_clicks`; empty where it is not simulated.
    array or None, shape (4, 4)
        T_base_mocap; None where it is not simulated.
    """
    simulation = read_simulation(recording)
    if not simulation:
        return pd.DataFrame(), None
    from hicp_lib.simulation.sensors.clicks import simulate_clicks

    exact, offset_s = np.array(simulation["T_base_mocap"]), simulation["mocap_offset_s"]
    return simulate_clicks(recording, mocap, exact, n_images, noise_px, offset_s, seed), exact


def _given(recording: Recording) -> r.Registration:
    file, n_clicks = r.REGISTRATION_FILE, eight_clicks.N_MARKERS
    if (recording.folder / file).is_file():
        return r.read_registration(recording.folder / file)
    raise InputError(
        f"{recording.folder}: has neither {CLICKS_FILE} (frame,marker,u_px,v_px) nor {file}; click {n_clicks}"
        " or more markers with hicp_lib.mocap.clicking, or give T_base_mocap"
    )


def registration_readings(
    people: Sequence[Registered], n_images: int = 12, noise_px: float = 1.0, n_draws: int = 100, seed: int = 0
) -> pd.DataFrame | None:
    """Error of `hicp_lib.mocap.eight_clicks.register_by_camera_marker` for each interpretation of the paper.

    Parameters
    ----------
    people : sequence of Registered
        Of motion capture with a marker on the camera.
    n_images : int
    noise_px : float
        Of the simulated clicks, as of `register`.
    n_draws : int
        Number of random selections, per person, of two images and eight markers clicked in them; the same for
        every interpretation.
    seed : int
        Of clicks and draws.

    Returns
    -------
    pd.DataFrame or None
        Columns `reading, turned_rad` (median angle to the true rotation), `added_m, low_m, high_m` (median
        displacement of the person's markers: median and 95 % range over people and draws), `n_people,
        n_draws`; None if no recording is simulated.

    Raises
    ------
    InputError
        If fewer than three clicks have a depth, or the camera has no marker.
    """
    known = [(seed + k, one, one.exact) for k, one in enumerate(people) if one.exact is not None]
    tables = [_drawn_readings(one, exact, n_images, noise_px, n_draws, drawn) for drawn, one, exact in known]
    if not tables:
        return None
    of_reading = pd.concat(tables).groupby("reading", sort=False)
    low_m, high_m = (of_reading["added_m"].quantile(percent / 100) for percent in PERCENTILES)
    medians = of_reading[["turned_rad", "added_m"]].median()
    counts = {"n_people": len(tables), "n_draws": of_reading.size()}
    return medians.assign(low_m=low_m, high_m=high_m, **counts).reset_index()


def _drawn_readings(
    registered: Registered, exact: np.ndarray, n_images: int, noise_px: float, n_draws: int, seed: int
) -> pd.DataFrame:
    """`compare_registrations` of every reading, in every draw."""
    recording, mocap, offset_s = registered.recording, registered.mocap, registered.offset_s
    clicks, _ = simulated_clicks(recording, mocap, n_images, noise_px, seed)
    base = r.lift_clicks(recording, clicks, mocap, offset_s)
    sharp, _ = simulated_clicks(recording, mocap, n_images, 0.0, seed)
    sharp = r.lift_clicks(recording, sharp, mocap, offset_s)
    near = r.lift_clicks(recording, clicks, mocap, offset_s, _NEAR_M)
    true = base.assign(**dict(zip(r.SEEN, transform(exact, base[r.MEASURED].to_numpy()).T, strict=True)))
    marker_m, centre_m = eight_clicks.camera_places(recording, mocap, offset_s)
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
            fit = eight_clicks.register_by_camera_marker(table.iloc[eight], at_m, centre_m, about_camera)
            found.append(replace(fit, method=name))
    some = replace(mocap, times_s=mocap.times_s[::_EVERY], points_m=mocap.points_m[::_EVERY])
    return compare_registrations(found, some, exact).rename(columns={"method": "reading"})


def _in_common(tables: list[pd.DataFrame]) -> list[pd.DataFrame]:
    """The clicks that have a depth of the person in all tables, in one order."""
    common = tables[0][_CLICK]
    for table in tables:
        common = common.merge(table.loc[r.keeps_distances(table), _CLICK])
    return [common.merge(table) for table in tables]


def _draw_eights(frames: np.ndarray, n_draws: int, seed: int) -> list[np.ndarray]:
    """Rows of eight clicks in two images, for each draw; fewer, if no two images have enough."""
    in_two = [np.flatnonzero(np.isin(frames, two)) for two in combinations(np.unique(frames), 2)]
    n = min(eight_clicks.N_MARKERS, max(map(len, in_two)))
    enough, rng = [rows for rows in in_two if len(rows) >= n], np.random.default_rng(seed)
    return [rng.permutation(enough[k])[:n] for k in rng.integers(len(enough), size=n_draws)]
