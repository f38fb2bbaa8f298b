"""Reads data/icub.json: Denavit-Hartenberg tables, joint limits, cables, camera holders, parts.

Distal convention, as iKin and the robot's documentation have it: a row turns by `theta + offset` about
z, moves `d` along z and `a` along x, and turns by `alpha` about x. data/README.md names the sources.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from hicp_lib.core.datafiles import DATA_DIR
from hicp_lib.core.errors import InputError
from hicp_lib.core.files import read_json
from hicp_lib.core.memo import memoised

ICUB_FILE = DATA_DIR / "icub.json"
COLUMNS = ["joint", "link", "a_m", "d_m", "alpha_deg", "offset_deg"]


@dataclass(frozen=True)
class Row:
    """One row of a Denavit-Hartenberg table; without a joint (None) it is held at zero."""

    joint: str | None
    link: str
    a_m: float
    d_m: float
    alpha_rad: float
    offset_rad: float


@dataclass(frozen=True)
class Cable:
    """A bound on a sum of joint angles, from the cables inside the shoulder; infinite where open."""

    joints: dict[str, float]
    lower_rad: float
    upper_rad: float


@dataclass(frozen=True, eq=False)
class Tables:
    """What data/icub.json says; angles in radians, lengths in metres.

    Attributes
    ----------
    T_root_base : (4, 4), before the first row
    torso : the first two rows of every chain
    heads : version -> rows of torso yaw and neck
    eyes : "head" (the point between the eyes, eyes held straight), "left_eye", "right_eye" -> last rows
    arms : version -> side -> rows of torso yaw and arm
    limits_rad : set of limits ("table" or "software") -> joint -> (lowest, highest)
    T_head_camera : name of the camera holder -> (4, 4), pose of the colour camera in the head-centre frame
    parts : part of the skin -> (chain, link) whose frame it is described in
    """

    T_root_base: np.ndarray
    torso: tuple[Row, ...]
    heads: dict[str, tuple[Row, ...]]
    eyes: dict[str, tuple[Row, ...]]
    arms: dict[str, dict[str, tuple[Row, ...]]]
    limits_rad: dict[str, dict[str, tuple[float, float]]]
    cables: tuple[Cable, ...]
    T_head_camera: dict[str, np.ndarray]
    parts: dict[str, tuple[str, str]]


@memoised(4)
def read_tables(path: Path = ICUB_FILE) -> Tables:
    """The robot's tables.

    Raises
    ------
    InputError
        If the file is missing, or a table in it is incomplete or not numbers.
    """
    data = read_json(path)
    try:
        if data["columns"] != COLUMNS:
            raise ValueError(f"columns are not {', '.join(COLUMNS)}")
        return _tables(data)
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise InputError(
            f"{path}: not the robot's tables ({error!r}); restore the file from the repository"
        ) from None


def _tables(data: dict[str, Any]) -> Tables:
    limits = _limits(data["limits_deg"])
    return Tables(
        T_root_base=_transform(data["T_root_base"]),
        torso=_rows(data["torso"]),
        heads={version: _rows(rows) for version, rows in data["head"].items()},
        eyes={name: _rows(rows) for name, rows in data["eyes"].items()},
        arms={
            version: {side: _rows(rows) for side, rows in sides.items()}
            for version, sides in data["arm"].items()
        },
        limits_rad={"table": limits, "software": limits | _limits(data["software_limits_deg"])},
        cables=tuple(_cable(cable) for cable in data["cables"]),
        T_head_camera={
            name: _transform(holder["T_head_camera_m"]) for name, holder in data["camera_mounts"].items()
        },
        parts={name: (part["chain"], part["link"]) for name, part in data["parts"].items()},
    )


def _rows(rows: list[list[Any]]) -> tuple[Row, ...]:
    return tuple(
        Row(joint, link, float(a), float(d), np.deg2rad(float(alpha)), np.deg2rad(float(offset)))
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
    lower, upper = cable["limits_deg"]
    return Cable(
        {joint: float(factor) for joint, factor in cable["joints"].items()},
        -np.inf if lower is None else float(np.deg2rad(lower)),
        np.inf if upper is None else float(np.deg2rad(upper)),
    )


def _transform(rows: list[list[float]]) -> np.ndarray:
    """A (4, 4) transform with the rotation nearest to the rounded numbers."""
    T = np.array(rows, dtype=float)
    if T.shape != (4, 4) or not np.isfinite(T).all():
        raise ValueError("a transform is not 4 x 4 numbers")
    u, _, vt = np.linalg.svd(T[:3, :3])
    if np.abs(u @ vt - T[:3, :3]).max() > 1e-4:
        raise ValueError("a transform is not a rotation and a translation")
    T[:3, :3] = u @ vt
    return T
