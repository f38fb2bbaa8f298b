"""Motion capture as Qualisys Track Manager exports it: TSV (3D data) and C3D, in and out.

Files are in millimetres, everything here in metres. Sources: the Qualisys documentation, "Motion
data (.tsv)", and headers of exports found in public repositories; for C3D, ezc3d.
"""

import math
import re
from dataclasses import dataclass
from pathlib import Path
from typing import NoReturn

import numpy as np

from hicp_lib.core.errors import InputError
from hicp_lib.core.files import read_bytes, write_bytes
from hicp_lib.recordings import c3d

_NUMBER = re.compile(r"\s*[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?\s*")
_MISSING = ("", "NULL", "null", "NaN", "nan", "NAN", "-nan")
_MAX_RATE_HZ = 1e5
_SHOWN = 40  # characters of a wrong value that a message repeats


@dataclass(frozen=True)
class MotionCapture:
    """Trajectories of markers in the motion capture system's own world frame.

    Attributes
    ----------
    times_s : array, shape (n,)
        Increasing, on the motion capture system's own clock.
    names : tuple of str
        Of the m markers, no two alike.
    points_m : array, shape (n, m, 3)
        All three NaN where a marker was not measured.
    rate_hz : float
        Measurements per second.
    """

    times_s: np.ndarray
    names: tuple[str, ...]
    points_m: np.ndarray
    rate_hz: float


def read_mocap(path: str | Path) -> MotionCapture:
    """Read a Qualisys export: 3D data as ``.tsv``, or ``.c3d``.

    TSV: keys may repeat, and unknown ones are passed over; column titles and the Frame and Time
    columns are optional. A marker is missing where a coordinate is empty, NULL or NaN, or where
    all three are exactly zero. Time starts at 0 at frame 1 unless the file has a Time column.

    Parameters
    ----------
    path : str or Path

    Returns
    -------
    MotionCapture

    Raises
    ------
    InputError
        If the file is missing, damaged, or not 3D data; the row of a TSV file is named.

    Examples
    --------
    >>> from tempfile import TemporaryDirectory
    >>> mocap = MotionCapture(np.array([0.0, 0.01]), ("wrist",), np.array([[[0.1, 0.2, 0.3]]] * 2), 100.0)
    >>> with TemporaryDirectory() as folder:
    ...     write_tsv(Path(folder, "mocap.tsv"), mocap)
    ...     read_mocap(Path(folder, "mocap.tsv")).points_m[1, 0]
    array([0.1, 0.2, 0.3])
    """
    path = Path(path)
    if path.suffix.lower() == ".c3d":
        points_m, names, rate_hz = c3d.read_points(path)
        times_s = np.arange(len(points_m)) / rate_hz
        return MotionCapture(times_s, names, _without_missing(points_m), rate_hz)
    if path.suffix.lower() == ".tsv":
        return _read_tsv(path)
    raise InputError(f"{path}: expected motion capture as .tsv or .c3d; export it so from Qualisys")


def write_tsv(path: str | Path, mocap: MotionCapture) -> None:
    """Write 3D data as Qualisys exports them: header, column titles, Frame and Time, missing markers empty.

    Millimetres are written to three decimals, seconds to five.

    Parameters
    ----------
    path : str or Path
    mocap : MotionCapture
    """
    n, m = mocap.points_m.shape[:2]
    header = {
        "NO_OF_FRAMES": n, "NO_OF_CAMERAS": 0, "NO_OF_MARKERS": m, "FREQUENCY": f"{mocap.rate_hz:.10g}",
        "NO_OF_ANALOG": 0, "ANALOG_FREQUENCY": 0, "DESCRIPTION": "--", "DATA_INCLUDED": "3D",
        "MARKER_NAMES": "\t".join(mocap.names), "TRAJECTORY_TYPES": "\t".join(["Measured"] * m),
    }  # fmt: skip
    lines = [f"{key}\t{value}" for key, value in header.items()]
    lines.append("\t".join(["Frame", "Time", *(f"{name} {axis}" for name in mocap.names for axis in "XYZ")]))
    for number, (time_s, points_m) in enumerate(zip(mocap.times_s, mocap.points_m, strict=True), start=1):
        fields = ["" if math.isnan(x) else f"{x:.3f}" for x in (1e3 * points_m).ravel().tolist()]
        lines.append("\t".join([str(number), f"{time_s:.5f}", *fields]))
    write_bytes(path, ("\r\n".join(lines) + "\r\n").encode())


def write_c3d(path: str | Path, mocap: MotionCapture) -> None:
    """Write C3D in millimetres, single precision; missing markers have the residual -1.

    C3D has no column of times: the first frame is at 0, as `read_mocap` reads it.

    Parameters
    ----------
    path : str or Path
    mocap : MotionCapture

    Raises
    ------
    InputError
        For more frames than the format counts to.
    """
    c3d.write_points(path, mocap.points_m, mocap.names, mocap.rate_hz)


def _read_tsv(path: Path) -> MotionCapture:
    raw = read_bytes(path, "give the path of a TSV file")
    lines = re.split(r"\r\n|\n|\r", c3d.decoded(raw).rstrip("\r\n \x1a"))
    start = next((k for k, line in enumerate(lines) if _is_data(line)), None)
    if start is None:
        _refuse_without_data(path, lines)
    header = _header(lines[:start])
    names, rate_hz = _names(path, header), _rate_hz(path, header)
    values = _numbers(path, lines, start)
    times_s, coordinates_mm = _split_columns(path, values, len(names), rate_hz, start + 1)
    _check_count(path, header, "NO_OF_FRAMES", len(values), "rows of data")
    points_m = 1e-3 * coordinates_mm.reshape(len(values), -1, 3)
    return MotionCapture(times_s, names, _without_missing(points_m), rate_hz)


def _is_data(line: str) -> bool:
    fields = line.split("\t")
    return len(fields) >= 3 and all(f.strip() in _MISSING or _NUMBER.fullmatch(f) for f in fields)


def _refuse_without_data(path: Path, lines: list[str]) -> NoReturn:
    for number, line in enumerate(lines, start=1):
        if "," in line and _is_data(line.replace(",", ".")):
            raise InputError(f"{path}: row {number}: decimal comma; export with a decimal point")
    raise InputError(f"{path}: no row of numbers; expected a Qualisys export of 3D data, separated by tabs")


def _header(lines: list[str]) -> dict[str, list[str]]:
    """Values by key, of the first line with that key; all else above the data is passed over."""
    header: dict[str, list[str]] = {}
    for line in lines:
        key, *values = (field.strip() for field in line.split("\t"))
        header.setdefault(key, values)
    return header


def _names(path: Path, header: dict[str, list[str]]) -> tuple[str, ...]:
    included = header.get("DATA_INCLUDED", ["3D"])[:1]
    if "BODY_NAMES" in header or included not in ([], [""], ["3D"]):
        raise InputError(f"{path}: holds {'/'.join(included)[:_SHOWN]} or rigid bodies; export 3D data")
    if "MARKER_NAMES" not in header:
        raise InputError(f"{path}: no line MARKER_NAMES above the data; export with the TSV header")
    values = "\t".join(header["MARKER_NAMES"]).rstrip("\t").split("\t")
    twice = next((name for k, name in enumerate(values) if name in values[:k]), None)
    if "" in values or twice:
        wrong = f"names {twice[:_SHOWN]!r} twice" if twice else "has an empty name"
        raise InputError(f"{path}: MARKER_NAMES {wrong}; give every marker a name of its own")
    _check_count(path, header, "NO_OF_MARKERS", len(values), "names in MARKER_NAMES")
    return tuple(values)


def _rate_hz(path: Path, header: dict[str, list[str]]) -> float:
    text = (header.get("FREQUENCY") or ["absent"])[0]
    if not _NUMBER.fullmatch(text) or not 0 < float(text) <= _MAX_RATE_HZ:
        raise InputError(f"{path}: FREQUENCY is {text[:_SHOWN]!r}; expected measurements per second")
    return float(text)


def _check_count(path: Path, header: dict[str, list[str]], key: str, found: int, what: str) -> None:
    """Refuse a file whose header counts otherwise; an unreadable count says nothing."""
    stated = (header.get(key) or [""])[0]
    if stated.isascii() and stated.isdigit() and stated != str(found):
        raise InputError(f"{path}: {key} is {stated[:_SHOWN]} but there are {found} {what}; export it again")


def _numbers(path: Path, lines: list[str], start: int) -> np.ndarray:
    """The rows of data, NaN where a field is empty."""
    rows, width = [], lines[start].count("\t") + 1
    for number, line in enumerate(lines[start:], start=start + 1):
        fields = line.split("\t")
        if len(fields) != width:
            text = f"row {number} has {len(fields)} columns, row {start + 1} has {width}"
            raise InputError(f"{path}: {text}; export it again")
        rows.append([_number(f"{path}: row {number}, column", k, f) for k, f in enumerate(fields, start=1)])
    return np.array(rows)


def _number(where: str, column: int, field: str) -> float:
    text = field.strip()
    value = math.nan if text in _MISSING else float(text) if _NUMBER.fullmatch(text) else math.inf
    if math.isinf(value):
        hint = "export with a decimal point" if "," in text else "expected a number or nothing"
        raise InputError(f"{where} {column} is {text[:_SHOWN]!r}; {hint}")
    return value


def _split_columns(
    path: Path, values: np.ndarray, n_markers: int, rate_hz: float, row: int
) -> tuple[np.ndarray, np.ndarray]:
    """Times (n,) by the columns Frame and Time, if there are such, and the columns of coordinates."""
    extra = values.shape[1] - 3 * n_markers
    # Some exports end every line with a tab: one more column, and empty.
    for leading in (extra, extra - 1) if np.isnan(values[:, -1]).all() else (extra,):
        times_s = _times_s(values[:, :leading], rate_hz) if 0 <= leading <= 2 else None
        if times_s is not None:
            return times_s, values[:, leading : leading + 3 * n_markers]
    expected = f"expected 3 for each of {n_markers} markers, after Frame and Time if exported"
    raise InputError(f"{path}: row {row} has {values.shape[1]} columns; {expected}")


def _times_s(leading: np.ndarray, rate_hz: float) -> np.ndarray | None:
    """Times by at most two columns, None if they are not Frame, Time or both: what counts up."""
    if leading.shape[1] == 0:
        return np.arange(len(leading)) / rate_hz
    first, last = leading[:, 0], leading[:, -1]
    is_frame = first[0] == np.round(first[0]) and (np.diff(first) == 1).all()
    if leading.shape[1] == 1 and is_frame:
        return (first - 1) / rate_hz
    is_time = np.allclose(np.diff(last), 1 / rate_hz, rtol=1e-3, atol=2e-5) and last[0] >= 0
    return last.copy() if is_time and (is_frame or leading.shape[1] == 1) else None


def _without_missing(points_m: np.ndarray) -> np.ndarray:
    missing = np.isnan(points_m).any(axis=2) | (points_m == 0).all(axis=2)
    return np.where(missing[..., None], np.nan, points_m)
