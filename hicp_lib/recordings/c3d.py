"""C3D files: the trajectories of markers, in and out, through ezc3d."""

import subprocess
import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from hicp_lib.core.errors import InputError
from hicp_lib.core.extras import needs
from hicp_lib.core.files import atomic_path, read_bytes

with needs("analysis"):
    import ezc3d

_UNITS_M = {"mm": 1e-3, "cm": 1e-2, "m": 1.0}
_MAX_RATE_HZ = 1e5
MAX_FRAMES = 65535  # that the format's own header counts to
_TIMEOUT_S = 300
_MAX_MEMORY_BYTES = 8 * 2**30

# ezc3d takes a damaged file's word for its size, which can end the process: so in one of its own.
_CONVERT = """
import sys
try:
    import resource
    resource.setrlimit(resource.RLIMIT_AS, (int(sys.argv[3]), int(sys.argv[3])))
except (ImportError, ValueError, OSError):  # no such limit on this system
    pass
import ezc3d, numpy
file = ezc3d.c3d(sys.argv[1])
point = file["parameters"]["POINT"]
labels = sorted((key for key in point if key.startswith("LABELS")), key=lambda key: int(key[6:] or 1))
numpy.savez(
    sys.argv[2],
    points=file["data"]["points"][:3],
    residuals=file["data"]["meta_points"]["residuals"][0],
    names=numpy.array([name for key in labels for name in point[key]["value"]], dtype=str),
    rate=numpy.ravel(point["RATE"]["value"])[:1],
    units=numpy.array(point["UNITS"]["value"], dtype=str),
)
"""


Points = tuple[np.ndarray, tuple[str, ...], float]


def read_points(path: Path) -> Points:
    """Read the markers of a C3D file.

    Parameters
    ----------
    path : Path

    Returns
    -------
    points_m : array, shape (n, m, 3)
        NaN where the residual is negative.
    names : tuple of str
        Of the m markers, no two alike.
    rate_hz : float
        Frames per second.

    Raises
    ------
    InputError
        If the file is missing, damaged, or lacks names, rate or unit of length.

    Examples
    --------
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_points(Path(folder, "mocap.c3d"), np.ones((5, 2, 3)), ("elbow", "wrist"), 100.0)
    ...     points_m, names, rate_hz = read_points(Path(folder, "mocap.c3d"))
    >>> points_m.shape, names, rate_hz
    ((5, 2, 3), ('elbow', 'wrist'), 100.0)
    """
    head = read_bytes(path, "give the path of a C3D file")[:10]
    if len(head) < 10 or head[1:2] != b"\x50":
        raise InputError(f"{path}: is not a C3D file (its second byte is not 80); export it again")
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "points.npz"
        command = [sys.executable, "-P", "-c", _CONVERT, str(path), str(out), str(_MAX_MEMORY_BYTES)]
        try:
            subprocess.run(command, capture_output=True, timeout=_TIMEOUT_S, check=True)
        except subprocess.SubprocessError:
            raise InputError(f"{path}: cannot be read as C3D; it may be cut off, export it again") from None
        with np.load(out, allow_pickle=False) as stored:
            points = _checked(path, stored)
    _refuse_cut_off(path, head, len(points[0]))
    return points


def _checked(path: Path, stored: Mapping[str, np.ndarray]) -> Points:
    """Points, names and rate of what `_CONVERT` stored."""
    points, rate, units = stored["points"], stored["rate"], stored["units"]
    names = tuple(str(name).strip() for name in stored["names"][: points.shape[1]])
    if not names or len(names) != points.shape[1] or len(set(names)) != len(names) or "" in names:
        raise InputError(f"{path}: POINT:LABELS does not name every marker once; name them in Qualisys")
    if not len(rate) or not 0 < rate[0] <= _MAX_RATE_HZ:
        raise InputError(f"{path}: POINT:RATE is missing or wrong; expected frames per second")
    if not len(units) or str(units[0]) not in _UNITS_M:
        raise InputError(f"{path}: POINT:UNITS is none of {', '.join(_UNITS_M)}; export it again")
    points_m = np.moveaxis(points, 0, -1).swapaxes(0, 1) * _UNITS_M[str(units[0])]
    valid = (stored["residuals"].T >= 0) & np.isfinite(points_m).all(axis=2)
    return np.where(valid[..., None], points_m, np.nan), names, float(rate[0])


def _refuse_cut_off(path: Path, head: bytes, n_frames: int) -> None:
    """ezc3d keeps quiet about frames that are missing at the end; the fourth and fifth word number them."""
    first, last = np.frombuffer(head, "<u2")[3:5].astype(int)
    if n_frames == MAX_FRAMES:
        raise InputError(f"{path}: {n_frames} frames are all C3D counts to, more may be missing; export TSV")
    if n_frames < last - first + 1:
        raise InputError(f"{path}: holds {n_frames} of {last - first + 1} frames: cut off, export it again")


def write_points(path: str | Path, points_m: np.ndarray, names: tuple[str, ...], rate_hz: float) -> None:
    """Write markers in millimetres, single precision; NaN gets the residual -1.

    Parameters
    ----------
    path : str or Path
    points_m : array, shape (n, m, 3)
    names : tuple of str
        Of the m markers.
    rate_hz : float
        Frames per second.

    Raises
    ------
    InputError
        For more frames than the format counts to.
    """
    if len(points_m) >= MAX_FRAMES:
        raise InputError(f"{path}: C3D takes fewer than {MAX_FRAMES} frames, not {len(points_m)}; write TSV")
    file = ezc3d.c3d()
    point = file["parameters"]["POINT"]
    point["RATE"]["value"], point["UNITS"]["value"] = [rate_hz], ["mm"]
    point["LABELS"]["value"] = list(names)
    missing = np.isnan(points_m).any(axis=2).T
    points_mm = np.ones((4, *missing.shape))
    points_mm[:3] = np.where(missing, np.nan, 1e3 * np.moveaxis(points_m, -1, 0).swapaxes(1, 2))
    file["data"]["points"] = points_mm
    file["data"]["meta_points"]["residuals"] = np.where(missing, -1.0, 0.0)[None]
    with atomic_path(path) as temporary:
        file.write(str(temporary))
