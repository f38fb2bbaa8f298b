"""Read and write trajectories of markers in C3D files, with ezc3d.

A C3D file describes its data layout twice: in its first block and in its parameters. ezc3d uses the
parameters. Here both are compared; if they differ, the file's size decides, or the file is refused.
"""

from __future__ import annotations

import tempfile
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from hicp_lib.core.errors import InputError
from hicp_lib.core.extras import needs
from hicp_lib.core.files import atomic_path, natural_order, read_bytes
from hicp_lib.core.limited import limited_child

with needs("analysis"):
    import ezc3d

if TYPE_CHECKING:
    from hicp_lib.recordings.qualisys import MotionCapture

# The longer ones are beginnings of unit names: old files truncate them to four letters.
_UNITS_M = {"mm": 1e-3, "cm": 1e-2, "m": 1.0, "in": 0.0254, "ft": 0.3048}
_UNITS_M |= {"mill": 1e-3, "cent": 1e-2, "met": 1.0, "inch": 0.0254, "feet": 0.3048, "foot": 0.3048}
MAX_RATE_HZ = 1e5
_SAME_SHARE = 0.005  # tolerance between the two values of a rate or scale
_PARAMETERS = ("RATE", "SCALE", "FRAMES", "DATA_START")
_BLOCK_BYTES = 512
MAX_FRAMES = 65535  # the most frames that the format's header can count

Points = tuple[np.ndarray, tuple[str, ...], float]
Said = Mapping[str, np.ndarray]
"""Values of the parameters of POINT."""


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
        Of the m markers, unique: equal names are numbered, a missing one becomes "unnamed".
    rate_hz : float
        Frames per second.

    Raises
    ------
    InputError
        If the file is missing, damaged, lacks names, rate or unit of length, or contradicts itself.

    Examples
    --------
    >>> from hicp_lib.recordings.qualisys import MotionCapture
    >>> mocap = MotionCapture(np.arange(5) / 100, ("elbow", "wrist"), np.ones((5, 2, 3)), 100.0)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_c3d(Path(folder, "mocap.c3d"), mocap)
    ...     points_m, names, rate_hz = read_points(Path(folder, "mocap.c3d"))
    >>> points_m.shape, names, rate_hz
    ((5, 2, 3), ('elbow', 'wrist'), 100.0)
    """
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder, "points.npy")
        names, rate_hz = limited_child(path, _convert, str(out))
        return np.load(out, allow_pickle=False), tuple(names), rate_hz


def _convert(path: str, out: str) -> tuple[tuple[str, ...], float]:
    """Write the points; return names and rate. ezc3d trusts a damaged file's sizes."""
    raw = read_bytes(path, "give the path of a C3D file")
    if raw[1:2] != b"\x50":
        raise InputError(f"{path}: is not a C3D file (its second byte is not 80); export it again")
    file = ezc3d.c3d(path)
    points, analogs = file["data"]["points"], file["data"]["analogs"]
    said = {name: np.ravel(of["value"]) for name, of in file["parameters"]["POINT"].items() if "value" in of}
    n_analog = analogs.size // max(points.shape[2], 1)
    _refuse_contradictions(path, raw, said, points.shape, n_analog)
    points_m, names, rate_hz = _checked(path, points, file["data"]["meta_points"]["residuals"][0], said)
    np.save(out, points_m)
    return names, rate_hz


def decoded(raw: bytes) -> str:
    """Text of an export; if it is not UTF-8, it is read in a code page in which every byte is a character.

    Examples
    --------
    >>> decoded("épaule".encode()), decoded("épaule".encode("latin-1"))
    ('épaule', 'épaule')
    """
    try:
        return raw.decode("utf-8-sig")
    except UnicodeDecodeError:
        return raw.decode("latin-1")


def _checked(path: str, points: np.ndarray, residuals: np.ndarray, said: Said) -> Points:
    """Points, names and rate."""
    points, rate = points[:3], said.get("RATE", np.zeros(0))
    if points.shape[2] == 0:
        raise InputError(f"{path}: holds no frames; export it again, or as TSV")
    lists = sorted((key for key in said if key.startswith("LABELS")), key=natural_order)
    labels = [str(name) for key in lists for name in said[key]]
    names = [decoded(name.encode(errors="surrogateescape")).strip() for name in labels]
    names = _distinct([*names, *[""] * points.shape[1]][: points.shape[1]])
    if not labels or len(set(names)) != max(len(names), 1):
        raise InputError(f"{path}: POINT:LABELS does not name the markers; name them in Qualisys")
    if not len(rate) or not 0 < rate[0] <= MAX_RATE_HZ:
        raise InputError(f"{path}: POINT:RATE is missing or wrong; expected frames per second")
    found = {_unit_m(str(unit)) for unit in said.get("UNITS", np.zeros(0)) if str(unit).strip()}
    if len(found) != 1 or None in found:
        raise InputError(f"{path}: POINT:UNITS is none of mm, cm, m, in, ft; export it again")
    points_m = np.moveaxis(points, 0, -1).swapaxes(0, 1) * found.pop()
    valid = (residuals.T >= 0) & np.isfinite(points_m).all(axis=2)
    return np.where(valid[..., None], points_m, np.nan), tuple(names), float(rate[0])


def _distinct(names: Sequence[str]) -> list[str]:
    """Names, numbered where several are equal, so that none is mistaken for the intended one."""
    total, so_far, distinct = Counter(names), Counter[str](), []
    for name in names:
        so_far[name] += 1
        distinct.append((name or "unnamed") + (f"_{so_far[name]}" if total[name] > 1 else ""))
    return distinct


def _unit_m(text: str) -> float | None:
    unit = text.strip().lower()
    return next((m for u, m in _UNITS_M.items() if unit == u or (len(u) > 2 and unit.startswith(u))), None)


def _refuse_contradictions(
    path: str, raw: bytes, parameters: Said, shape: tuple[int, ...], n_analog_read: int
) -> None:
    words = np.frombuffer(raw[:24], "<u2")
    is_dec = raw[_BLOCK_BYTES * (raw[0] - 1) + 3] == 85  # halves of a float swapped, and four times as large
    floats = words[[7, 6, 11, 10] if is_dec else [6, 7, 10, 11]].view("<f4") / (4 if is_dec else 1)
    n_points, n_analog, first, last, _, _, _, start = words[1:9].tolist()
    said = {name: parameters.get(name, np.zeros(0)) for name in _PARAMETERS}
    of = {name: float(value[0]) if len(value) else 0.0 for name, value in said.items()}
    if not np.isfinite([*floats, *of.values()]).all():
        raise InputError(f"{path}: its rate or scale is no number; export it again, or as TSV")
    pairs = [("RATE", floats[1]), ("DATA_START", start), ("SCALE", floats[0])]
    wrong = [
        f"POINT:{name} ({header:g}, {of[name]:g})" for name, header in pairs
        if min(header, of[name]) > 0 and abs(header - of[name]) > _SAME_SHARE * of[name]
    ]  # fmt: skip
    _, m, n = shape
    stated = (4 * n_points + n_analog) * (4 if floats[0] < 0 else 2)
    frame_bytes = (4 * m + n_analog_read) * (4 if of["SCALE"] < 0 else 2)
    data_bytes = len(raw) - _BLOCK_BYTES * (start - 1)
    if stated != frame_bytes and (_fits(data_bytes, n * stated) or not _fits(data_bytes, n * frame_bytes)):
        wrong.append(f"the bytes from frame to frame ({stated}, {frame_bytes})")
    if wrong:
        told = f"header and parameters disagree on {', '.join(wrong)}"
        raise InputError(f"{path}: {told}; export it again, or as TSV")
    header, frames, by_size = last - first + 1, int(of["FRAMES"]), data_bytes // max(frame_bytes, 1)
    # Counts that overflow stay at the maximum or wrap around: the file is then larger.
    is_counted = header == n < MAX_FRAMES and frames in (0, n) and by_size - n < MAX_FRAMES
    if not is_counted:
        counts = f"{header} (header), {frames} (POINT:FRAMES), {by_size} (size of the file)"
        hint = "it is cut off, or too long for C3D; export it again, or as TSV"
        raise InputError(f"{path}: holds {n} frames, counts {counts}; {hint}")


def _fits(file_bytes: int, data_bytes: int) -> bool:
    """Whether data fill a file up to the end of the last block."""
    return 0 <= file_bytes - data_bytes < _BLOCK_BYTES


def write_c3d(path: str | Path, mocap: MotionCapture) -> None:
    """Write markers in millimetres, single precision; missing ones have the residual -1.

    C3D has no column of times: the first frame is at 0, as `read_points` reads it.

    Parameters
    ----------
    path : str or Path
    mocap : MotionCapture

    Raises
    ------
    InputError
        For more frames than the format can count.
    """
    points_m = mocap.points_m
    if len(points_m) >= MAX_FRAMES:
        raise InputError(f"{path}: C3D takes fewer than {MAX_FRAMES} frames, not {len(points_m)}; write TSV")
    file = ezc3d.c3d()
    point = file["parameters"]["POINT"]
    point["RATE"]["value"], point["UNITS"]["value"] = [mocap.rate_hz], ["mm"]
    point["LABELS"]["value"] = list(mocap.names)
    missing = np.isnan(points_m).any(axis=2).T
    points_mm = np.ones((4, *missing.shape))
    points_mm[:3] = np.where(missing, np.nan, 1e3 * np.moveaxis(points_m, -1, 0).swapaxes(1, 2))
    file["data"]["points"] = points_mm
    file["data"]["meta_points"]["residuals"] = np.where(missing, -1.0, 0.0)[None]
    with atomic_path(path) as temporary:
        file.write(str(temporary))
