"""The text files of the TUM RGB-D layout: lists of images, camera poses, and how they go together.

A line of `rgb.txt` or `depth.txt` is "timestamp filename", one of `groundtruth.txt` is
"timestamp tx ty tz qx qy qz qw"; `#` starts a comment. Timestamps are seconds and increase.
Layout and association as in the tools of Sturm et al., *A Benchmark for the Evaluation of RGB-D
SLAM Systems*, IROS 2012.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path, PurePosixPath, PureWindowsPath

import numpy as np

from hicp_lib.core.errors import InputError
from hicp_lib.core.files import write_bytes
from hicp_lib.core.quaternions import matrices_from_quaternions, quaternions_from_matrices

MAX_DIFFERENCE_S = 0.02  # images and poses further apart in time do not belong together
_UNIT_TOLERANCE = 0.01  # a quaternion's length may differ from 1 by this much: files are rounded
_POSE_COLUMNS = "timestamp tx ty tz qx qy qz qw"


def read_file_list(path: str | Path) -> tuple[np.ndarray, list[str]]:
    """Read a list of images: times (n,) in seconds, and names relative to the list's folder.

    Raises
    ------
    InputError
        If the file cannot be read, is empty, or a line is not "timestamp filename" with a time
        after the one before and a name inside the folder.
    """
    times_s, names = [], []
    for number, fields in _rows(path):
        if len(fields) != 2:
            raise _error(path, number, f"has {len(fields)} fields; expected 'timestamp filename'")
        if not _is_inside(fields[1]):
            raise _error(path, number, f"names {fields[1]!r}; expected a file inside the recording's folder")
        times_s.append(_time_s(path, number, fields[0], times_s))
        names.append(fields[1])
    return _not_empty(path, np.array(times_s)), names


def read_poses(path: str | Path) -> tuple[np.ndarray, np.ndarray]:
    """Read poses: times (n,) in seconds, and T_base_cam (n, 4, 4) in metres.

    Raises
    ------
    InputError
        If the file cannot be read, is empty, or a line is not eight finite numbers with a time
        after the one before and a quaternion of length 1.
    """
    rows: list[list[float]] = []
    for number, fields in _rows(path):
        if len(fields) != 8:
            raise _error(path, number, f"has {len(fields)} fields; expected '{_POSE_COLUMNS}'")
        time_s = _time_s(path, number, fields[0], [row[0] for row in rows[-1:]])
        rows.append([time_s, *(_number(path, number, field) for field in fields[1:])])
        length = np.linalg.norm(rows[-1][4:])
        if not abs(length - 1) <= _UNIT_TOLERANCE:
            raise _error(
                path, number, f"has a quaternion of length {length:.4g}; expected qx qy qz qw of length 1"
            )
    table = _not_empty(path, np.array(rows).reshape(-1, 8))
    T_base_cam = np.tile(np.eye(4), (len(table), 1, 1))
    T_base_cam[:, :3, :3] = matrices_from_quaternions(table[:, 4:])
    T_base_cam[:, :3, 3] = table[:, 1:4]
    return table[:, 0], T_base_cam


def write_file_list(path: str | Path, times_s: np.ndarray, names: Sequence[str]) -> None:
    """Write a list of images, whole or not at all; times to the microsecond."""
    lines = [f"{time_s:.6f} {name}" for time_s, name in zip(times_s, names, strict=True)]
    _write(path, ["# timestamp filename", *lines])


def write_poses(path: str | Path, times_s: np.ndarray, T_base_cam: np.ndarray) -> None:
    """Write poses T_base_cam (n, 4, 4), whole or not at all; w is not negative."""
    T = np.asarray(T_base_cam, float)
    quaternions = quaternions_from_matrices(T[:, :3, :3])
    rows = np.column_stack([T[:, :3, 3], quaternions])
    lines = [
        " ".join([f"{time_s:.6f}", *(f"{value:.9f}" for value in row)])
        for time_s, row in zip(times_s, rows, strict=True)
    ]
    _write(path, [f"# {_POSE_COLUMNS}; camera in the robot's base frame, metres", *lines])


def associate(
    a_s: np.ndarray, b_s: np.ndarray, max_difference_s: float = MAX_DIFFERENCE_S
) -> tuple[np.ndarray, np.ndarray]:
    """Pair times with times, each at most once, the smallest differences first.

    Parameters
    ----------
    a_s, b_s : arrays, shapes (n,) and (m,), increasing

    Returns
    -------
    Rows of `a_s` and of `b_s`, both of shape (k,), in the order of `a_s`
    """
    low, high = (np.searchsorted(b_s, a_s + sign * max_difference_s, side) for sign, side in _WINDOW)
    n_candidates = high - low
    a = np.repeat(np.arange(len(a_s)), n_candidates)
    b = np.arange(len(a)) + np.repeat(low - np.cumsum(n_candidates) + n_candidates, n_candidates)
    free_a, free_b = np.ones(len(a_s), bool), np.ones(len(b_s), bool)
    for k in np.argsort(np.abs(a_s[a] - b_s[b]), kind="stable"):
        if free_a[a[k]] and free_b[b[k]]:
            free_a[a[k]] = free_b[b[k]] = False
        else:
            a[k] = -1
    return a[a >= 0], b[a >= 0]


_WINDOW = ((-1, "left"), (1, "right"))


def _rows(path: str | Path) -> Iterator[tuple[int, list[str]]]:
    """Line number and fields of every line that says something."""
    try:
        text = Path(path).read_text(encoding="utf-8")
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}); a recording needs it") from None
    except UnicodeDecodeError:
        raise InputError(f"{path}: is not text in UTF-8; expected a text file of the TUM layout") from None
    for number, line in enumerate(text.split("\n"), start=1):
        fields = line.partition("#")[0].split()
        if fields:
            yield number, fields


def _time_s(path: str | Path, number: int, text: str, before_s: list[float]) -> float:
    time_s = _number(path, number, text)
    if before_s and not time_s > before_s[-1]:
        raise _error(path, number, f"timestamp {text} is not after the one before; sort the lines by time")
    return time_s


def _number(path: str | Path, number: int, text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = np.nan
    if not abs(value) < 1e15:
        raise _error(path, number, f"{text[:40]!r} is not a finite number; expected seconds and metres")
    return value


def _is_inside(name: str) -> bool:
    """Whether a file name cannot lead out of its folder, on any system."""
    windows = PureWindowsPath(name)
    is_relative = not (windows.drive or windows.root or PurePosixPath(name).root)
    return is_relative and ".." not in windows.parts and name.isprintable()


def _not_empty(path: str | Path, values: np.ndarray) -> np.ndarray:
    if len(values) == 0:
        raise InputError(f"{path}: holds no lines; expected one per image or pose")
    return values


def _error(path: str | Path, number: int, problem: str) -> InputError:
    return InputError(f"{path}: line {number}: {problem}")


def _write(path: str | Path, lines: list[str]) -> None:
    write_bytes(path, ("\n".join(lines) + "\n").encode())
