"""Read data/icub.json: Denavit-Hartenberg tables, joint limits, cables, camera holders, parts.

Distal convention, as iKin and the robot's documentation have it: a row rotates by `theta + offset` about z,
translates by `d` along z and `a` along x, and rotates by `alpha` about x. data/README.md names the sources.
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from hicp_lib.core.datafiles import DATA_DIR
from hicp_lib.core.errors import InputError
from hicp_lib.core.files import read_json
from hicp_lib.core.memo import memoised

ICUB_FILE = DATA_DIR / "icub.json"
COLUMNS = ["joint", "link", "a_m", "d_m", "alpha_deg", "offset_deg"]
Read = TypeVar("Read")
_MAX_SKEW = 1e-4  # tolerance of a rotation matrix, since numbers are rounded


Row = tuple[str | None, str, float, float, float, float]
"""One row of a Denavit-Hartenberg table: joint (none: fixed at zero), the frame after the row,
a and d (metres), alpha and offset (radians)."""

Cable = tuple[dict[str, float], tuple[float, float]]
"""A bound on a sum of joint angles, from the cables inside the shoulder: joint -> factor; lowest and highest
sum in radians, infinite where open."""


@dataclass(frozen=True, eq=False)
class Tables:
    """The content of data/icub.json; angles in radians, lengths in metres.

    Attributes
    ----------
    T_root_base : array, shape (4, 4)
        Before the first row.
    heads : dict of str to dict
        Version -> "head" (the point between the eyes, eyes held straight), "left_eye", "right_eye" -> rows.
    arms : dict of str to dict
        Version -> side -> rows.
    limits_rad : dict of str to dict
        Set of limits ("table" or "software") -> joint -> (lowest, highest).
    cables : tuple of Cable
    T_head_camera : dict of str to array, shape (4, 4)
        Name of the camera holder -> pose of the colour camera in the head-centre frame.
    parts : dict of str to tuple of str
        Part of the skin -> (chain, link) whose frame it is described in.
    capsules : tuple of tuple
        Part of the body, chain and link where it begins and where it ends ("tips" are a hand's), radius in
        metres; fingers with the thumb.
    """

    T_root_base: np.ndarray
    heads: dict[str, dict[str, tuple[Row, ...]]]
    arms: dict[str, dict[str, tuple[Row, ...]]]
    limits_rad: dict[str, dict[str, tuple[float, float]]]
    cables: tuple[Cable, ...]
    T_head_camera: dict[str, np.ndarray]
    parts: dict[str, tuple[str, str]]
    capsules: tuple[tuple[str, str, str, float], ...]


@memoised(4)
def read_tables(path: Path = ICUB_FILE) -> Tables:
    """The robot's tables.

    Parameters
    ----------
    path : Path, optional

    Returns
    -------
    Tables

    Raises
    ------
    InputError
        If the file is missing, or a table in it is incomplete or not numbers.

    Examples
    --------
    >>> tables = read_tables()
    >>> list(tables.heads), list(tables.arms), list(tables.T_head_camera)
    (['v1', 'v2'], ['v1', 'v1.7', 'v2'], ['level', 'tilted'])
    """
    return read_robot_file(path, "tables", COLUMNS, _tables)


def read_robot_file(path: Path, what: str, columns: list[str], parse: Callable[[dict], Read]) -> Read:
    """Read a JSON file of this project about the robot.

    Parameters
    ----------
    path : Path
    what : str
        What the file contains, for the error message.
    columns : list of str
        Required value of its key `columns`.
    parse : callable
        Converts its content to the result; may raise anything but `OSError` for malformed content.

    Returns
    -------
    object
        The result of `parse`.

    Raises
    ------
    InputError
        If the file is missing, has other columns, or cannot be parsed.
    """
    data = read_json(path)
    try:
        if data["columns"] != columns:
            raise ValueError(f"columns are not {', '.join(columns)}")
        return parse(data)
    except (KeyError, TypeError, ValueError, AttributeError, RecursionError) as error:
        wrong = f"not the robot's {what} ({error!r})"
        raise InputError(f"{path}: {wrong}; restore the file from the repository") from None


def _tables(data: dict[str, Any]) -> Tables:
    torso, limits = data["torso"], _limits(data["limits_deg"])
    return Tables(
        T_root_base=_transform(data["T_root_base"]),
        heads={
            version: {name: _rows(torso + neck + eye) for name, eye in data["eyes"].items()}
            for version, neck in data["head"].items()
        },
        arms={
            version: {side: _rows(torso + rows) for side, rows in sides.items()}
            for version, sides in data["arm"].items()
        },
        limits_rad={"table": limits, "software": limits | _limits(data["software_limits_deg"])},
        cables=tuple(_cable(cable) for cable in data["cables"]),
        T_head_camera={
            name: _transform(holder["T_head_camera_m"]) for name, holder in data["camera_mounts"].items()
        },
        parts={name: (part["chain"], part["link"]) for name, part in data["parts"].items()},
        capsules=tuple(
            (part, begin, end, float(radius_m)) for part, begin, end, radius_m in data["capsules"]
        ),
    )


def _rows(rows: list[list[Any]]) -> tuple[Row, ...]:
    return tuple(
        (joint, link, float(a), float(d), np.deg2rad(float(alpha)), np.deg2rad(float(offset)))
        for joint, link, a, d, alpha, offset in rows
    )


def _limits(limits_deg: dict[str, list[float]]) -> dict[str, tuple[float, float]]:
    limits = {}
    for joint, (lowest, highest) in limits_deg.items():
        if not lowest < highest:
            raise ValueError(f"limits of {joint} are not lowest < highest")
        limits[joint] = (float(np.deg2rad(lowest)), float(np.deg2rad(highest)))
    return limits


def _cable(cable: dict[str, Any]) -> Cable:
    given = zip(cable["limits_deg"], (-np.inf, np.inf), strict=True)
    low_rad, high_rad = (float(np.deg2rad(none if limit is None else limit)) for limit, none in given)
    return {joint: float(factor) for joint, factor in cable["joints"].items()}, (low_rad, high_rad)


def _transform(rows: list[list[float]]) -> np.ndarray:
    """A (4, 4) transform with the rotation nearest to the rounded numbers."""
    T = np.array(rows, dtype=float)
    if T.shape != (4, 4) or not np.isfinite(T).all():
        raise ValueError("a transform is not 4 x 4 numbers")
    u, _, vt = np.linalg.svd(T[:3, :3])
    if np.abs(u @ vt - T[:3, :3]).max() > _MAX_SKEW:
        raise ValueError("a transform is not a rotation and a translation")
    T[:3, :3] = u @ vt
    return T
