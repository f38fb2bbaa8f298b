"""The robot's tactile skin: positions and normals of its taxels.

Taxels of palms and forearms have the positions of the robot's own software. For the upper arms and the front
of the torso only their number is documented; they are placed on simple cylinders, which is an assumption
(data/icub_skin.json has the cylinders, data/README.md the sources).
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from hicp_lib.core.datafiles import DATA_DIR
from hicp_lib.core.memo import memoised
from hicp_lib.robot.kinematics import ICub
from hicp_lib.robot.posture import Posture
from hicp_lib.robot.tables import read_robot_file

SKIN_FILE = DATA_DIR / "icub_skin.json"
COLUMNS = ["x_mm", "y_mm", "z_mm", "normal_x", "normal_y", "normal_z"]


@dataclass(frozen=True, eq=False)
class Skin:
    """Taxels of all parts, one after another.

    Attributes
    ----------
    slices : dict of str to slice
        Part, such as "left_forearm" -> its rows in the arrays.
    positions_m, normals : array, shape (n, 3)
        In the frame of the part's link; normals are unit vectors, outward.
    """

    slices: dict[str, slice]
    positions_m: np.ndarray
    normals: np.ndarray

    def __len__(self) -> int:
        return len(self.positions_m)

    def in_root(self, icub: ICub, posture: Posture) -> tuple[np.ndarray, np.ndarray]:
        """All taxels in the root frame.

        Parameters
        ----------
        icub : ICub
        posture : Posture

        Returns
        -------
        positions_m, normals : array, shape (n, 3)
        """
        chains = {icub.parts[part][0] for part in self.slices}
        links = {chain: icub.chains[chain].T_root_links(posture.angles(chain)) for chain in chains}
        positions, normals = np.empty_like(self.positions_m), np.empty_like(self.normals)
        for part, rows in self.slices.items():
            chain, link = icub.parts[part]
            T = links[chain][link]
            positions[rows] = self.positions_m[rows] @ T[:3, :3].T + T[:3, 3]
            normals[rows] = self.normals[rows] @ T[:3, :3].T
        return positions, normals


@memoised(4)
def read_skin(path: Path = SKIN_FILE) -> Skin:
    """The taxels of the project's robot.

    Parameters
    ----------
    path : Path, optional

    Returns
    -------
    Skin

    Raises
    ------
    InputError
        If the file is missing, or a part of it is incomplete or not numbers.

    Examples
    --------
    >>> skin = read_skin()
    >>> skin.positions_m[skin.slices["left_hand"]].shape
    (5, 3)
    """
    return read_robot_file(path, "skin", COLUMNS, _skin)


def _skin(data: dict[str, Any]) -> Skin:
    taxels = {part: _taxels(part, data["parts"]) for part in data["parts"]}
    ends = np.cumsum([len(rows) for rows in taxels.values()]).tolist()
    rows = np.concatenate(list(taxels.values()))
    return Skin(
        slices={part: slice(a, b) for part, a, b in zip(taxels, [0, *ends], ends, strict=False)},
        positions_m=1e-3 * rows[:, :3],
        normals=rows[:, 3:] / np.linalg.norm(rows[:, 3:], axis=1, keepdims=True),
    )


def _taxels(part: str, parts: dict[str, Any]) -> np.ndarray:
    """Rows (k, 6) of one part: position in mm, normal."""
    ((kind, given),) = parts[part].items()
    if kind == "patch":
        return _patch(**given)
    if kind == "mirrors":
        return _mirrored(parts, **given)
    rows = np.array(given, dtype=float)
    if rows.ndim != 2 or rows.shape[1] != len(COLUMNS) or not np.isfinite(rows).all():
        raise ValueError(f"taxels of {part} are not rows of {len(COLUMNS)} numbers")
    return rows


def _mirrored(
    parts: dict[str, Any], part: str, position_factors: list, normal_factors: list, shift_mm: list
) -> np.ndarray:
    """The taxels of another part in a frame that is rotated and slightly shifted relative to that part's."""
    return _taxels(part, parts) * [*position_factors, *normal_factors] + [*shift_mm, 0, 0, 0]


def _patch(
    start_mm: list, end_mm: list, front_mm: list, side_mm: list, arc_deg: list, rows: int, columns: int
) -> np.ndarray:
    """A grid on an elliptic cylinder: `rows` from start to end of its axis, `columns` over the arc.

    `front_mm` and `side_mm` are the half-axes; angle 0 is at the front, 90 degrees at the side.
    """
    first_deg, last_deg = arc_deg
    angles = np.deg2rad(np.linspace(first_deg, last_deg, columns))
    axis, angle = np.meshgrid(np.linspace(0, 1, rows), angles, indexing="ij")
    front, side = np.array(front_mm, dtype=float), np.array(side_mm, dtype=float)
    cos, sin = np.cos(angle)[..., None], np.sin(angle)[..., None]
    centres = np.array(start_mm) + axis[..., None] * (np.array(end_mm) - np.array(start_mm))
    normals = cos * front / (front @ front) + sin * side / (side @ side)
    return np.concatenate([centres + cos * front + sin * side, normals], axis=-1).reshape(-1, 6)
