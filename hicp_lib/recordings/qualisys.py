"""Read and write motion capture in Qualisys Track Manager's export formats: TSV (3D data) and C3D.

Files are in millimetres, everything here in metres. Sources: the Qualisys documentation, "Motion
data (.tsv)", and headers of exports found in public repositories; for C3D, ezc3d.
"""

import math
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from hicp_lib.core.errors import InputError
from hicp_lib.core.files import read_bytes, write_bytes
from hicp_lib.recordings.c3d import MAX_RATE_HZ, decoded, read_points

_NUMBER = re.compile(r"\s*[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?\s*")
_MISSING = ("", "NULL", "null", "NaN", "nan", "NAN", "-nan")
_TIME_CODE = re.compile(r"\d+(:\d+)+([:;.]\d+)*")  # SMPTE, IRIG
_SAID_ONCE = ("FREQUENCY", "MARKER_NAMES", "NO_OF_FRAMES", "NO_OF_MARKERS")
MAX_MARKER_M = 10_000.0  # from the origin, in any direction
_SHOWN = 40  # characters of a wrong value shown in a message


@dataclass(frozen=True)
class MotionCapture:
    """Trajectories of markers in the motion capture system's own world frame.

    Attributes
    ----------
    times_s : array, shape (n,)
        Increasing, on the motion capture system's own clock.
    names : tuple of str
        Of the m markers, unique.
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

    TSV: unknown keys are ignored; column titles and the columns Frame, Time and time code (SMPTE) are
    optional. A marker is missing where a coordinate is empty, NULL or NaN, or where all three are exactly
    zero. Time starts at 0 at frame 1 unless the file has a Time column, which also gives the rate if
    FREQUENCY is EXT.

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
    if path.suffix.lower() not in (".c3d", ".tsv"):
        raise InputError(f"{path}: expected motion capture as .tsv or .c3d; export it so from Qualisys")
    if path.suffix.lower() == ".tsv":
        mocap = _read_tsv(path)
    else:
        points_m, names, rate_hz = read_points(path)
        mocap = MotionCapture(np.arange(len(points_m)) / rate_hz, names, points_m, rate_hz)
    far = np.argwhere(np.abs(mocap.points_m) > MAX_MARKER_M)
    for frame, k, axis in far[:1]:
        where = f"marker {mocap.names[k][:_SHOWN]!r} in frame {frame + 1}"
        wrong = f"is at {mocap.points_m[frame, k, axis]:.6g} m; expected at most {MAX_MARKER_M:g}"
        raise InputError(f"{path}: {where} {wrong}, export missing markers as missing")
    missing = np.isnan(mocap.points_m).any(axis=2) | (mocap.points_m == 0).all(axis=2)
    mocap.points_m[missing] = np.nan
    return mocap


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


def _read_tsv(path: Path) -> MotionCapture:
    raw = read_bytes(path, "give the path of a TSV file")
    lines = re.split(r"\r\n|\n|\r", decoded(raw).rstrip("\r\n \x1a"))
    start = next((k for k, line in enumerate(lines) if _is_data(line)), None)
    if start is None:
        raise InputError(
            f"{path}: no row of numbers; expected a Qualisys export of 3D data, separated by tabs"
        )
    header = _header(path, lines[:start])
    names, rows = _names(path, header), _rows(path, lines, start)
    _check_count(path, header, "NO_OF_FRAMES", len(rows), "rows of data")
    n_leading = len(rows[0]) - 3 * len(names)
    titles = _titles(f"{path}: row {start}", lines[start - 1], names, len(rows[0]))
    leading = [[row[k] for row in rows] for k in range(n_leading)]
    rate_hz = _rate_hz(path, header)
    columns = {_kind(column, rate_hz): column for column in leading}
    is_told = n_leading == 0 or len(rows) > 1 or titles is not None
    as_titled = titles is None or {"Frame", "Time"}.intersection(titles) == {"Frame", "Time"} & columns.keys()
    if n_leading != len(columns) or "" in columns or not is_told or not as_titled:
        expected = f"expected 3 for each of {len(names)} markers, after Frame, Time and time code if exported"
        raise InputError(f"{path}: row {start + 1} has {len(rows[0])} columns; {expected}, as FREQUENCY says")
    times_s = np.array(columns.get("Time") or columns.get("Frame") or range(1, len(rows) + 1), float)
    if "Time" not in columns:
        times_s = (times_s - 1) / rate_hz
    elif math.isnan(rate_hz) and len(rows) > 1:
        rate_hz = 1 / float(np.median(np.diff(times_s)))
    if math.isnan(rate_hz):
        raise InputError(f"{path}: FREQUENCY is EXT, an external signal's; export it with the column Time")
    coordinates_mm = [
        [_number(f"{path}: row {number}, column {k + 1}", row[k]) for k in range(n_leading, len(row))]
        for number, row in enumerate(rows, start=start + 1)
    ]
    points_m = 1e-3 * np.array(coordinates_mm).reshape(len(rows), -1, 3)
    return MotionCapture(times_s, names, points_m, rate_hz)


def _is_data(line: str) -> bool:
    """Whether the first field that is not empty is a number, even a wrong one, or a time code."""
    fields = line.split("\t")
    first = next((field for field in map(str.strip, fields) if field not in _MISSING), "0")
    return len(fields) >= 3 and bool(re.match(r"[-+]?[.,]?\d[\d.,:;]*(e|$)|[-+]?inf", first, re.IGNORECASE))


def _header(path: Path, lines: list[str]) -> dict[str, list[str]]:
    """Values by key; all other lines above the data are ignored."""
    header: dict[str, list[str]] = {}
    for line in lines:
        key, *values = (field.strip() for field in line.rstrip().split("\t"))
        if header.setdefault(key, values) != values and key in _SAID_ONCE:
            raise InputError(f"{path}: {key} is there twice, and differs; export it again")
    return header


def _names(path: Path, header: dict[str, list[str]]) -> tuple[str, ...]:
    included = header.get("DATA_INCLUDED", ["3D"])[:1]
    if "BODY_NAMES" in header or included not in ([], [""], ["3D"]):
        raise InputError(f"{path}: holds {'/'.join(included)[:_SHOWN]} or rigid bodies; export 3D data")
    if "MARKER_NAMES" not in header:
        raise InputError(f"{path}: no line MARKER_NAMES above the data; export with the TSV header")
    values = header["MARKER_NAMES"] or [""]
    twice = next((name for k, name in enumerate(values) if name in values[:k]), None)
    if "" in values or twice:
        wrong = f"names {twice[:_SHOWN]!r} twice" if twice else "has an empty name"
        raise InputError(f"{path}: MARKER_NAMES {wrong}; give every marker a name of its own")
    _check_count(path, header, "NO_OF_MARKERS", len(values), "names in MARKER_NAMES")
    return tuple(values)


def _rate_hz(path: Path, header: dict[str, list[str]]) -> float:
    """NaN if an external signal triggered the measurements."""
    text = (header.get("FREQUENCY") or ["absent"])[0]
    if text == "EXT":
        return math.nan
    if not _NUMBER.fullmatch(text) or not 0 < float(text) <= MAX_RATE_HZ:
        raise InputError(f"{path}: FREQUENCY is {text[:_SHOWN]!r}; expected measurements per second")
    return float(text)


def _check_count(path: Path, header: dict[str, list[str]], key: str, found: int, what: str) -> None:
    """Refuse a file whose header states another count; an unreadable count is ignored."""
    stated = (header.get(key) or [""])[0]
    if stated.isascii() and stated.isdigit() and stated != str(found):
        raise InputError(f"{path}: {key} is {stated[:_SHOWN]} but there are {found} {what}; export it again")


def _rows(path: Path, lines: list[str], start: int) -> list[list[str]]:
    """The fields of the data, without the empty last column of exports that end every line with a tab."""
    rows, width = [], lines[start].count("\t") + 1
    for number, line in enumerate(lines[start:], start=start + 1):
        rows.append([field.strip() for field in line.split("\t")])
        if len(rows[-1]) != width:
            text = f"row {number} has {len(rows[-1])} columns, row {start + 1} has {width}"
            raise InputError(f"{path}: {text}; export it again")
    n_empty = next((k for k in range(width) if any(row[-1 - k] not in _MISSING for row in rows)), width)
    # A marker that was never seen leaves three columns empty.
    return [row[:-1] for row in rows] if n_empty % 3 == 1 else rows


def _titles(where: str, line: str, names: tuple[str, ...], width: int) -> list[str] | None:
    """Titles of the columns before the coordinates, None if the line is not a title line."""
    titles = [title.strip() for title in line.rstrip().split("\t")]
    axes = [(name, axis) for name in names for axis in "XYZ"]
    if titles[0].title() not in ("Frame", "Time", "Smpte") and f"{names[0]} X" not in titles:
        return None
    n_leading = max(width - len(axes), 0)
    if len(titles) != width or not all(
        title.startswith(name) and title.endswith(axis)
        for title, (name, axis) in zip(titles[n_leading:], axes, strict=False)
    ):
        raise InputError(f"{where}: titles are not those of MARKER_NAMES and of the columns; export it again")
    return [title.title() for title in titles[:n_leading]]


def _kind(column: list[str], rate_hz: float) -> str:
    """The kind of a column before the coordinates, by its content; "" if unknown."""
    if any(map(_TIME_CODE.fullmatch, column)):
        return "code" if all(field in _MISSING or _TIME_CODE.fullmatch(field) for field in column) else ""
    if not all(map(_NUMBER.fullmatch, column)):
        return ""
    values = np.array(column, float)
    steps = np.diff(values)
    if all(map(str.isdigit, column)) and (steps == 1).all():
        return "Frame"
    is_even = math.isnan(rate_hz) or np.allclose(steps, 1 / rate_hz, rtol=1e-3, atol=2e-5)
    return "Time" if is_even and (steps > 0).all() and values[0] >= 0 else ""


def _number(where: str, text: str) -> float:
    value = math.nan if text in _MISSING else float(text) if _NUMBER.fullmatch(text) else math.inf
    if math.isinf(value):
        hint = "export with a decimal point" if "," in text else "expected a number or nothing"
        raise InputError(f"{where} is {text[:_SHOWN]!r}; {hint}")
    return value
