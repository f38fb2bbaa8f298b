"""Peripersonal space: the activation of every taxel of the skin by the points around it.

The receptive field of a taxel is a truncated cone about its normal. A point inside it activates the taxel
depending on its distance only: the variant of Roncone et al. (2015) that the paper uses, without time to
contact. The activation is the probability that an object at this distance touches the skin later. The
original robot learned it as a histogram; here it is the hand-made histogram with a reach of 45 cm published
with it (data/README.md names the source), smoothed by Parzen windows. For each part, the taxels above a
threshold are summarised as one obstacle.
"""

from dataclasses import dataclass
from functools import cache, cached_property

import numpy as np
from numpy.typing import ArrayLike

from hicp_lib.robot.skin import Skin

BIN_M = 0.025
HISTOGRAM_START_M = -0.05
POSITIVES = np.array([480, 555, 480, 160, 80, 60, 50, 40, 35, 25, 15, 10, 6, 3, 1, 0, 0, 0, 0, 0])
NEGATIVES = np.full(20, 100)
"""Events per bin of distance, 20 bins from -5 to 45 cm: followed by a touch, and not."""

ACTIVATION_THRESHOLD = 0.2
"""Default threshold above which taxels belong to an obstacle; reached at about 19 cm."""

_TABLE_STEP_M = 1e-4
_TABLE_M = np.arange(-0.2, 0.6, _TABLE_STEP_M)
_NEGLIGIBLE = 1e-3
_BLOCK = 136  # points at once: intermediate arrays for one person fit into the processor's cache


@dataclass(frozen=True)
class ReceptiveField:
    """The receptive field of a taxel.

    Attributes
    ----------
    half_angle_rad, skin_radius_m : float
        The cone's opening, and its radius at the skin (50 degrees and 7 cm since September 2016; 40 degrees
        and 5 cm before). It is round here and also opens behind the skin; the robot's software uses a square
        cross-section, along axes of the taxels that are not published.
    point_radius_m : float
        Every point is a sphere of this radius (3.5 cm: Nguyen et al. 2018, around keypoints).

    Examples
    --------
    A point 10 cm in front of a taxel, and one behind its cone:

    >>> taxel, up = np.zeros((1, 3)), np.array([[0.0, 0.0, 1.0]])
    >>> field = ReceptiveField()
    >>> field.activations(taxel, up, np.array([[0, 0, 0.1]]), np.ones(1)).round(2)
    array([0.54], dtype=float32)
    >>> field.activations(taxel, up, np.array([[0.2, 0, 0.05]]), np.ones(1))
    array([0.], dtype=float32)
    """

    half_angle_rad: float = np.deg2rad(50.0)
    skin_radius_m: float = 0.07
    point_radius_m: float = 0.035

    @cached_property
    def table(self) -> np.ndarray:
        """Responses at `_TABLE_M` as single-precision numbers, for the look-up."""
        return response(_TABLE_M).astype(np.float32)

    @cached_property
    def reach_m(self) -> float:
        """Distance of a point beyond which activations are below 0.001."""
        return float(_TABLE_M[np.flatnonzero(self.table > _NEGLIGIBLE)[-1]]) + self.point_radius_m

    def activations(
        self, positions_m: np.ndarray, normals: np.ndarray, points_m: np.ndarray, gains: np.ndarray
    ) -> np.ndarray:
        """Activation of every taxel: the maximum over the points.

        Parameters
        ----------
        positions_m, normals : array, shape (n, 3)
            Taxels, in the same frame as the points.
        points_m : array, shape (m, 3)
            Non-finite points are left out.
        gains : array, shape (m,)
            Factor on the response to each point, at least 0.

        Returns
        -------
        array, shape (n,), dtype float32
            0 if nothing is near.
        """
        points, gains = self._near(positions_m, np.asarray(points_m, dtype=float), np.asarray(gains))
        if not len(points):
            return np.zeros(len(positions_m), dtype=np.float32)
        # Relative to the centre of the points, so that single precision is enough
        middle = points.mean(axis=0)
        taxels, normals = (positions_m - middle).astype(np.float32), normals.astype(np.float32)
        points, gains = (points - middle).astype(np.float32), gains.astype(np.float32)
        highest = np.zeros(len(taxels), dtype=np.float32)
        for start in range(0, len(points), _BLOCK):
            block = slice(start, start + _BLOCK)
            activation = self._pairwise(taxels, normals, points[block]) * gains[block]
            np.maximum(highest, activation.max(axis=1), out=highest)
        return highest

    def _pairwise(self, taxels: np.ndarray, normals: np.ndarray, points: np.ndarray) -> np.ndarray:
        """Response of every taxel to every point, (n, m); the arrays are single-precision."""
        height = normals @ points.T
        height -= np.einsum("ij,ij->i", normals, taxels)[:, None]
        square = (-2 * taxels) @ points.T
        square += np.einsum("ij,ij->i", taxels, taxels)[:, None] + np.einsum("ij,ij->i", points, points)
        np.maximum(square, 0, out=square)
        # The square of the distance at which the cone's surface is crossed on the way to the point
        cone = np.float32(np.tan(self.half_angle_rad)) * np.abs(height)
        cone += np.float32(self.skin_radius_m)
        cone *= cone
        cone += height * height
        inside = square <= cone
        place = np.copysign(np.sqrt(square, out=square), height, out=square)
        place -= np.float32(self.point_radius_m + _TABLE_M[0] - _TABLE_STEP_M / 2)
        place *= np.float32(1 / _TABLE_STEP_M)
        return self.table.take(place.astype(np.int32), mode="clip") * inside

    def _near(
        self, positions_m: np.ndarray, points_m: np.ndarray, gains: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Points that may activate a taxel, by a box around all taxels."""
        low, high = positions_m.min(axis=0) - self.reach_m, positions_m.max(axis=0) + self.reach_m
        near = (gains > 0) & ((points_m >= low) & (points_m <= high)).all(axis=1)
        return points_m[near], gains[near]


@dataclass(frozen=True, eq=False)
class Obstacle:
    """An obstacle near one part of the skin.

    Attributes
    ----------
    part : str
        Name of the part.
    point_m : array, shape (3,)
        Mean position of the activated taxels, weighted by activation; frame of the part's link.
    normal : array, shape (3,)
        Mean of their normals, weighted likewise; of length 1 or, if they differ, less.
    magnitude : float
        The highest activation.
    """

    part: str
    point_m: np.ndarray
    normal: np.ndarray
    magnitude: float


def response(distance_m: ArrayLike) -> np.ndarray:
    """Activation by a point at a distance from the skin, from 0 to 1.

    Parzen windows over the histogram: every bin's fraction of touches as a normal curve at the bin's left
    edge, with a bin's width as standard deviation.

    Parameters
    ----------
    distance_m : float or array
        Negative behind the skin.

    Returns
    -------
    array
        Of the same shape.

    Examples
    --------
    >>> response(np.array([0.0, 0.1, 0.3])).round(2)
    array([0.96, 0.43, 0.02])
    """
    return _parzen(np.asarray(distance_m, dtype=float)) / _highest()


def obstacles(skin: Skin, activations: np.ndarray, threshold: float = ACTIVATION_THRESHOLD) -> list[Obstacle]:
    """One obstacle for each part with taxels above the threshold.

    Parameters
    ----------
    skin : Skin
    activations : array, shape (n,)
        Of the skin's taxels.
    threshold : float, optional

    Returns
    -------
    list of Obstacle
    """
    found = []
    for part, rows in skin.slices.items():
        activation = activations[rows]
        if activation.max() > threshold:
            weights = np.where(activation > threshold, activation, 0).astype(float)
            weights /= weights.sum()
            point, normal = weights @ skin.positions_m[rows], weights @ skin.normals[rows]
            found.append(Obstacle(part, point, normal, float(activation.max())))
    return found


def _parzen(distance_m: np.ndarray) -> np.ndarray:
    share = POSITIVES / (POSITIVES + NEGATIVES)
    edges_m = HISTOGRAM_START_M + BIN_M * np.arange(len(share))
    return np.exp(-0.5 * ((distance_m[..., None] - edges_m) / BIN_M) ** 2) @ share


@cache
def _highest() -> float:
    return float(_parzen(np.arange(HISTOGRAM_START_M, 0.05, 1e-5)).max())
