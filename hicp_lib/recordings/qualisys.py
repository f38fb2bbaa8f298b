"""Motion capture as Qualisys Track Manager exports it: TSV (3D data) and C3D, in and out.

Files are in millimetres, everything here in metres. Sources: the Qualisys documentation, "Motion
data (.tsv)", and headers of exports found in public repositories; for C3D, ezc3d.
"""

from __future__ import annotations

import csv
import io
import math
import re
from dataclasses import dataclass
from pathlib import Path
from typing import NoReturn

import numpy as np
import pandas as pd

from hicp_lib.core.errors import InputError
from hicp_lib.core.files import write_bytes
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
    times_s : (n,), increasing, on the motion capture system's own clock
    names : of the m markers, no two alike
    points_m : (n, m, 3); all three NaN where a marker was not measured
    rate_hz : measurements per second
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

    Raises
    ------
    InputError
        If the file is missing, damaged, or not 3D data; the row of a TSV file is named.
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

    C3D has no column of times: the first frame is at 0, as `read_mocap` reads it. `InputError` for
    more frames than the format counts to.
    """
    c3d.write_points(path, mocap.points_m, mocap.names, mocap.rate_hz)


def _read_tsv(path: Path) -> MotionCapture:
    try:
        raw = path.read_bytes()
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}); give the path of a TSV file") from None
    # Marker names may be in the code page of the exporting computer; every byte is a letter there.
    text = raw.decode("utf-8-sig") if _is_utf8(raw) else raw.decode("latin-1")
    lines = re.split(r"\r\n|\n|\r", text.rstrip("\r\n \x1a"))
    start = next((k for k, line in enumerate(lines) if _is_data(line)), None)
    if start is None:
        _refuse_without_data(path, lines)
    header = _header(lines[:start])
    names, rate_hz = _names(path, header), _rate_hz(path, header)
    values = _numbers(path, lines, start)
    leading = _leading_columns(path, values, len(names), rate_hz, start + 1)
    _check_count(path, header, "NO_OF_FRAMES", len(values), "rows of data")
    points_m = 1e-3 * values[:, leading : leading + 3 * len(names)].reshape(len(values), -1, 3)
    return MotionCapture(_times_s(values[:, :leading], rate_hz), names, _without_missing(points_m), rate_hz)


def _is_utf8(raw: bytes) -> bool:
    try:
        raw.decode("utf-8-sig")
    except UnicodeDecodeError:
        return False
    return True


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
    values = header["MARKER_NAMES"]
    while values and not values[-1]:
        values = values[:-1]
    twice = next((name for k, name in enumerate(values) if name in values[:k]), None)
    if not values or "" in values or twice:
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
    width = lines[start].count("\t") + 1
    for number, line in enumerate(lines[start:], start=start + 1):
        found = line.count("\t") + 1
        if found != width:
            raise InputError(
                f"{path}: row {number} has {found} columns, row {start + 1} has {width}; export it again"
            )
    table = io.StringIO("\n".join(lines[start:]) + "\n")
    try:
        values = pd.read_csv(
            table, sep="\t", header=None, dtype=float, quoting=csv.QUOTE_NONE, skip_blank_lines=False,
            na_values=list(_MISSING), keep_default_na=False, skipinitialspace=True,
        ).to_numpy()  # fmt: skip
    except (ValueError, OverflowError):
        values = np.full((1, 1), np.inf)
    if np.isinf(values).any():
        _refuse_number(path, lines, start)
    return values


def _refuse_number(path: Path, lines: list[str], start: int) -> NoReturn:
    for number, line in enumerate(lines[start:], start=start + 1):
        for column, field in enumerate(line.split("\t"), start=1):
            text = field.strip()
            if text in _MISSING or (_NUMBER.fullmatch(text) and math.isfinite(float(text))):
                continue
            hint = "export with a decimal point" if "," in text else "expected a number or nothing"
            raise InputError(f"{path}: row {number}, column {column} is {text[:_SHOWN]!r}; {hint}")
    raise InputError(f"{path}: the rows from {start + 1} on are not all numbers; export it again")


def _leading_columns(path: Path, values: np.ndarray, n_markers: int, rate_hz: float, row: int) -> int:
    """How many columns (Frame, Time) come before the coordinates: those that count up."""
    extra = values.shape[1] - 3 * n_markers
    # Some exports end every line with a tab: one more column, and empty.
    for leading in (extra, extra - 1) if np.isnan(values[:, -1]).all() else (extra,):
        columns = [values[:, k] for k in range(leading)]
        if leading == 2 and _is_frame(columns[0]) and _is_time(columns[1], rate_hz):
            return leading
        if leading == 1 and (_is_frame(columns[0]) or _is_time(columns[0], rate_hz)) or leading == 0:
            return leading
    raise InputError(
        f"{path}: row {row} has {values.shape[1]} columns; expected 3 for each of {n_markers} markers, "
        "after Frame and Time if exported"
    )


def _is_frame(column: np.ndarray) -> bool:
    return bool(column[0] == np.round(column[0]) and (np.diff(column) == 1).all())


def _is_time(column: np.ndarray, rate_hz: float) -> bool:
    return bool(np.allclose(np.diff(column), 1 / rate_hz, rtol=1e-3, atol=2e-5) and column[0] >= 0)


def _times_s(leading: np.ndarray, rate_hz: float) -> np.ndarray:
    if leading.shape[1] == 0:
        return np.arange(len(leading)) / rate_hz
    if leading.shape[1] == 1 and _is_frame(leading[:, 0]):
        return (leading[:, 0] - 1) / rate_hz
    return leading[:, -1].copy()


def _without_missing(points_m: np.ndarray) -> np.ndarray:
    missing = np.isnan(points_m).any(axis=2) | (points_m == 0).all(axis=2)
    return np.where(missing[..., None], np.nan, points_m)
