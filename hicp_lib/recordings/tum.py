"""The text files of the TUM RGB-D layout: lists of images, camera poses, and their association by time.

A line of `rgb.txt` or `depth.txt` is "timestamp filename", one of `groundtruth.txt` is "timestamp tx ty tz qx
qy qz qw"; `#` starts a comment. Timestamps are seconds and increase. If a line above the poses names their
columns, as in EuRoC's CSV, columns are assigned by these names. Layout and association as in the tools of
Sturm et al., *A Benchmark for the Evaluation of RGB-D SLAM Systems*, IROS 2012.
"""

import re
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from hicp_lib.core.errors import InputError
from hicp_lib.core.files import atomic_path, read_bytes, write_bytes
from hicp_lib.core.names import is_inside
from hicp_lib.core.rotations import matrices_from_quaternions, quaternions_from_matrices

MAX_DIFFERENCE_S = 0.02  # images and poses further apart in time do not belong together
UNIT_TOLERANCE = 0.01  # a quaternion's length may differ from 1 by this much: files are rounded
_MAX_ABS = 1e20  # more is not a time
MAX_PLACE_M = 1e7  # more is not a place on Earth
_MAX_TIME_S = 1e11  # later than the year 5000: another unit
_MAX_COLUMNS = 100  # of a table that has poses
_SLOW_S = 5.0  # between two images: in milliseconds this is more usual
_LIST_COLUMNS = "timestamp filename"
_POSE_COLUMNS = "timestamp tx ty tz qx qy qz qw"
# Names of a coordinate: x, tx, p_x, p_RS_R_x [m]; of a quaternion component: qx, q_RS_x []
_COLUMN = re.compile(r"(?:([ptq])(?:\w*_)?)?([wxyz])")


def read_file_list(path: str | Path) -> tuple[np.ndarray, list[str]]:
    """Read a list of images.

    Parameters
    ----------
    path : str or Path
        Of `rgb.txt` or `depth.txt`.

    Returns
    -------
    times_s : array, shape (n,)
        Increasing: of lines with the same time the first is read (`remarks`).
    names : list of str
        Relative to the list's folder, and inside it.

    Raises
    ------
    InputError
        If the file cannot be read, is empty, or a line is not "timestamp filename" with a time
        not before the last one and a name inside the folder.

    Examples
    --------
    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder:
    ...     write_file_list(Path(folder, "rgb.txt"), np.array([0.0, 0.1]), ["rgb/0.jpg", "rgb/1.jpg"])
    ...     read_file_list(Path(folder, "rgb.txt"))
    (array([0. , 0.1]), ['rgb/0.jpg', 'rgb/1.jpg'])
    """
    times_s, names = [], []
    for number, time_s, (name,) in _rows(path, _LIST_COLUMNS):
        if not is_inside(name):
            raise _error(path, number, f"names {name[:80]!r}; expected a file inside the recording's folder")
        times_s.append(time_s)
        names.append(name)
    if len(set(names)) < len(names):
        raise InputError(f"{path}: names an image at two times; expected an image for each time")
    return np.array(times_s), names


def read_poses(path: str | Path) -> tuple[np.ndarray, np.ndarray]:
    """Read the poses of a camera.

    Parameters
    ----------
    path : str or Path
        Of `groundtruth.txt`.

    Returns
    -------
    times_s : array, shape (n,)
        Increasing: of lines with the same time the first is read (`remarks`).
    T_base_cam : array, shape (n, 4, 4)
        Camera coordinates to the robot's base frame, metres.

    Raises
    ------
    InputError
        If the file cannot be read, is empty, or a line is not eight finite numbers with a time
        not before the last one and a quaternion of length 1.
    """
    rows = []
    for number, time_s, fields in _rows(path, _POSE_COLUMNS):
        pose = [_number(path, number, field) for field in fields]
        if np.abs(pose[:3]).max() > MAX_PLACE_M:
            raise _error(path, number, f"{fields[:3]} is no place; expected metres, up to {MAX_PLACE_M:g}")
        length = np.linalg.norm(pose[3:])
        if not abs(length - 1) <= UNIT_TOLERANCE:
            wrong = f"has a quaternion of length {length:.4g}; expected qx qy qz qw of length 1"
            raise _error(path, number, wrong)
        rows.append([time_s, *pose])
    table = np.array(rows)
    T_base_cam = np.tile(np.eye(4), (len(table), 1, 1))
    T_base_cam[:, :3, :3] = matrices_from_quaternions(table[:, 4:])
    T_base_cam[:, :3, 3] = table[:, 1:4]
    return table[:, 0], T_base_cam


def write_file_list(path: str | Path, times_s: np.ndarray, names: Sequence[str]) -> None:
    """Write a list of images, whole or not at all; times to the microsecond.

    Parameters
    ----------
    path : str or Path
    times_s : array, shape (n,)
    names : sequence of str
        n of them, relative to the list's folder.
    """
    lines = [f"{time_s:.6f} {name}\n" for time_s, name in zip(times_s, names, strict=True)]
    write_bytes(path, "".join([f"# {_LIST_COLUMNS}\n", *lines]).encode())


def write_poses(path: str | Path, times_s: np.ndarray, T_base_cam: np.ndarray) -> None:
    """Write poses, whole or not at all; w is not negative.

    Parameters
    ----------
    path : str or Path
    times_s : array, shape (n,)
    T_base_cam : array, shape (n, 4, 4)
        Camera coordinates to the robot's base frame, metres.
    """
    T = np.asarray(T_base_cam, float)
    rows = np.column_stack([times_s, T[:, :3, 3], quaternions_from_matrices(T[:, :3, :3])])
    header = f"{_POSE_COLUMNS}; camera in the robot's base frame, metres"
    with atomic_path(path) as temporary:
        np.savetxt(temporary, rows, ["%.6f", *["%.9f"] * 7], header=header)


def associate(
    a_s: np.ndarray, b_s: np.ndarray, max_difference_s: float = MAX_DIFFERENCE_S
) -> tuple[np.ndarray, np.ndarray]:
    """Pair times with times, each at most once, the smallest differences first.

    Parameters
    ----------
    a_s, b_s : array, shape (n,) or (m,)
        Increasing.
    max_difference_s : float, optional
        Times that differ by more are not paired.

    Returns
    -------
    a, b : array of int, shape (k,)
        Paired rows of `a_s` and `b_s`, in the order of `a_s`.

    Examples
    --------
    >>> associate(np.array([0.0, 0.1, 0.2]), np.array([0.09, 0.105, 0.3]))
    (array([1]), array([1]))
    """
    low = np.searchsorted(b_s, a_s - max_difference_s, "left")
    n_candidates = np.searchsorted(b_s, a_s + max_difference_s, "right") - low
    a = np.repeat(np.arange(len(a_s)), n_candidates)
    b = np.arange(len(a)) + np.repeat(low - np.cumsum(n_candidates) + n_candidates, n_candidates)
    free_a, free_b = np.ones(len(a_s), bool), np.ones(len(b_s), bool)
    for k in np.argsort(np.abs(a_s[a] - b_s[b]), kind="stable"):
        if free_a[a[k]] and free_b[b[k]]:
            free_a[a[k]] = free_b[b[k]] = False
        else:
            a[k] = -1
    return a[a >= 0], b[a >= 0]


def names_poses(path: str | Path) -> bool:
    """Whether the first line of a file names the columns of poses (as EuRoC's CSV, not one of joints)."""
    first = read_bytes(path, "give a file of camera poses").partition(b"\n")[0]
    return _named_columns(first.decode("latin-1")) is not None


def remarks(path: str | Path, times_s: np.ndarray) -> list[str]:
    """Warnings about the times of a readable file.

    Parameters
    ----------
    path : str or Path
    times_s : array, shape (n,)
        As read: of lines with the same time only the first is used.

    Returns
    -------
    list of str
        Number of lines with repeated times; whether there are too few per second for times in seconds.
    """
    n = sum(bool(re.match(r"\s*[-+.]?\d", line)) for line in _text(path).split("\n")) - len(times_s)
    step_s = np.median(np.diff(times_s)) if len(times_s) > 1 else 0.0
    looks = f"times are expected in seconds (these look like {_prefix(step_s)}seconds)"
    told = [f"{n} lines repeat the time before and are skipped"] if n else []
    return [*told, f"{1 / step_s:.2g} frames per second; {looks}"] if step_s > _SLOW_S else told


def _prefix(step: float) -> str:
    """Prefix of the unit in which the time between two images is plausible."""
    return "milli" if step < 1e3 * _SLOW_S else "micro" if step < 1e6 * _SLOW_S else "nano"


def _text(path: str | Path) -> str:
    try:
        return read_bytes(path, "a recording needs it").decode("utf-8-sig")
    except UnicodeDecodeError:
        raise InputError(f"{path}: is not text in UTF-8; expected a text file of the TUM layout") from None


def _rows(path: str | Path, columns: str) -> Iterator[tuple[int, float, list[str]]]:
    """Line number, time and further fields of every line with a new time."""
    width = len(columns.split())
    order, before_s, unit_s, is_csv = [*range(width)], -np.inf, 1.0, False
    for number, line in enumerate(_text(path).split("\n"), start=1):
        named = _named_columns(line) if columns == _POSE_COLUMNS and np.isinf(before_s) else None
        if named:
            order, is_csv = named, "," in line
            continue
        fields = line.partition("#")[0].replace(",", " " if is_csv else ",").split()
        if not fields:
            continue
        if len(fields) <= max(order) or (len(fields) > width and not is_csv):
            raise _error(path, number, f"has {len(fields)} fields; expected '{columns}'")
        time_s = _number(path, number, fields[0]) * unit_s
        if abs(time_s) > _MAX_TIME_S:
            unit = f"{_prefix(_SLOW_S * abs(time_s) / _MAX_TIME_S)}seconds"
            if not is_csv or unit != "nanoseconds":
                wrong = f"timestamp {fields[0]} looks like {unit}; expected seconds, convert the times"
                raise _error(path, number, wrong)
            unit_s = 1e-9  # as EuRoC writes them
            time_s *= unit_s
        if time_s < before_s:
            late = f"timestamp {fields[0]} is before the last one; sort the lines by time"
            raise _error(path, number, late)
        if time_s > before_s:
            yield number, time_s, [fields[k] for k in order[1:]]
        before_s = time_s
    if np.isinf(before_s):
        raise InputError(f"{path}: holds no lines; expected one per image or pose")


def _named_columns(line: str) -> list[int] | None:
    """The indices of `_POSE_COLUMNS`, if the line names them."""
    names = re.sub(r"[\[(].*?[\])]", "", line.strip("# \r")).split("," if line.count(",") > 6 else None)
    found = [_COLUMN.fullmatch(name.strip(" ;")) for name in names[:_MAX_COLUMNS]]
    keys = [(m[1] or "qt"[m[2] != "w"]).replace("p", "t") + m[2] if m else "" for m in found]
    if not all(keys.count(name) == 1 for name in _POSE_COLUMNS.split()[1:]):
        return None
    return [0, *map(keys.index, _POSE_COLUMNS.split()[1:])]


def _number(path: str | Path, number: int, text: str) -> float:
    try:
        value = float(text.replace("_", " "))  # only Python writes numbers with underscores
    except ValueError:
        value = np.nan
    if not abs(value) < _MAX_ABS:
        raise _error(path, number, f"{text[:40]!r} is not a finite number; expected seconds and metres")
    return value


def _error(path: str | Path, number: int, problem: str) -> InputError:
    return InputError(f"{path}: line {number}: {problem}")
