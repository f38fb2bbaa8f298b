"""Squares around the ends of the forearms, where a body's hands should be, cut out for a hand model.

The rule is OpenPose's (Simon et al., "Hand keypoint detection in single images using multiview
bootstrapping", CVPR 2017, and its program): the hand lies a third of the forearm beyond the wrist, and the
square's side is a multiple of the arm's scale. That scale is the forearm's length in the image, or a fraction
of the upper arm's or the shoulders' if that is larger: a forearm that points at the camera, as at close
range, looks short.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import cv2
import numpy as np

from hicp_lib.core.detections import Detections
from hicp_lib.core.keypoints import LEFT_HAND, RIGHT_HAND

# Left, right.
_SHOULDERS, _ELBOWS, WRISTS = [5, 6], [7, 8], [9, 10]
HAND_POINTS = np.stack([LEFT_HAND, RIGHT_HAND])

# Aspect ratio from which an image is processed in squares. On seed 11 of an earlier set of bodies, none of
# them held out, the AP of hands is within .01 from 1.15 to 1.7; with 1.5 or more, a camera's images (4:3)
# need two runs less.
MIN_OBLONG = 1.5

# The data on which thresholds were chosen, by the AP of hands in 100 scenes of development identities; first
# on an earlier set of bodies, none of them held-out.
SEED_11, SEED_11_THUNDER = "seed 11, both body detectors", "seed 11, bodies by movenet-thunder"


def threshold(value: Any, chosen: str) -> Any:
    """A field of a rule that says in its metadata how its value was chosen, and on what data."""
    return field(default=value, metadata={"chosen": chosen})


@dataclass(frozen=True)
class SquareRule:
    """How squares are placed; each field says in its metadata how its value was chosen, and on what data.

    Attributes
    ----------
    beyond_wrist : float
        Position of the centre, in forearms beyond the wrist, away from the elbow.
    side : float
        In units of the arm's scale.
    forearms_per_upper_arm, forearms_per_shoulders : float
        Lower bounds of the forearm's length, as fractions of the upper arm's length and the shoulders'
        distance in the image.
    min_score : float
        Wrists with a lower score get no square.
    """

    beyond_wrist: float = threshold(0.33, "OpenPose's")
    side: float = threshold(2.7, f"{SEED_11_THUNDER}: 2.2 within .01")
    forearms_per_upper_arm: float = threshold(0.9, "OpenPose's")
    forearms_per_shoulders: float = threshold(0.6, f"{SEED_11_THUNDER}: 0.75 within .005")
    min_score: float = threshold(0.1, f"{SEED_11_THUNDER}: 0.03 within .005, and more looks")


@dataclass(frozen=True)
class Arms:
    """The arms of n bodies, left and right.

    Attributes
    ----------
    wrists_px, elbows_px, shoulders_px : array, shape (n, 2, 2)
        NaN where not given.
    scales_px : array, shape (n, 2)
        Length of the forearm, see `SquareRule`; NaN if unknown.
    """

    wrists_px: np.ndarray
    elbows_px: np.ndarray
    shoulders_px: np.ndarray
    scales_px: np.ndarray

    @classmethod
    def of(cls, bodies: Detections, rule: SquareRule) -> Arms:
        """The arms of bodies; wrists below the rule's score count as not given."""
        points = bodies.keypoints_px
        sure = bodies.scores[:, WRISTS] >= rule.min_score
        wrists = np.where(sure[..., None], points[:, WRISTS], np.nan)
        elbows, shoulders = points[:, _ELBOWS], points[:, _SHOULDERS]
        lengths = [
            np.linalg.norm(wrists - elbows, axis=-1),
            rule.forearms_per_upper_arm * np.linalg.norm(elbows - shoulders, axis=-1),
            rule.forearms_per_shoulders * np.linalg.norm(shoulders - shoulders[:, ::-1], axis=-1),
        ]
        longest = np.nan_to_num(np.stack(lengths), nan=0.0).max(axis=0)
        return cls(wrists, elbows, shoulders, np.where(longest > 0, longest, np.nan))

    @property
    def are_whole(self) -> np.ndarray:
        """Whether shoulder, elbow and wrist are given, shape (n, 2)."""
        joints_px = np.stack([self.wrists_px, self.elbows_px, self.shoulders_px])
        return np.isfinite(joints_px).all(axis=(0, -1))

    def hands_px(self, rule: SquareRule) -> np.ndarray:
        """Where the hands should be, shape (n, 2, 2): beyond the wrists; without an elbow, at the wrist."""
        return self.wrists_px + rule.beyond_wrist * np.nan_to_num(self.wrists_px - self.elbows_px)


@dataclass(frozen=True)
class Square:
    """A square part of an image, whole pixels: columns left_px to left_px + side_px - 1, rows likewise."""

    left_px: int
    top_px: int
    side_px: int

    @classmethod
    def around(cls, centre_px: np.ndarray, side_px: float) -> Square:
        """The square of about this side whose centre is nearest to a position, pixel centres at integers.

        Examples
        --------
        >>> Square.around((10.0, 20.0), 5.2)
        Square(left_px=8, top_px=18, side_px=5)
        """
        side = max(2, round(side_px))
        left, top = np.round(np.asarray(centre_px) - (side - 1) / 2).astype(int).tolist()
        return cls(left, top, side)

    def overlaps(self, image: np.ndarray) -> bool:
        """Whether it overlaps the image."""
        height, width = image.shape[:2]
        return -self.side_px < self.left_px < width and -self.side_px < self.top_px < height

    def cut(self, image: np.ndarray, min_side_px: int) -> np.ndarray:
        """Its pixels, black outside the image, enlarged to `min_side_px` when smaller."""
        height, width = image.shape[:2]
        end_x, end_y = self.left_px + self.side_px, self.top_px + self.side_px
        inside = image[max(self.top_px, 0) : max(end_y, 0), max(self.left_px, 0) : max(end_x, 0)]
        pixels = cv2.copyMakeBorder(
            inside,
            max(-self.top_px, 0), max(end_y - height, 0), max(-self.left_px, 0), max(end_x - width, 0),
            cv2.BORDER_CONSTANT, value=(0, 0, 0),
        )  # fmt: skip
        if self.side_px >= min_side_px:
            return pixels
        return cv2.resize(pixels, (min_side_px, min_side_px), interpolation=cv2.INTER_CUBIC)

    def to_image_px(self, positions_px: np.ndarray, min_side_px: int) -> np.ndarray:
        """Positions (..., 2) in the pixels of `cut` as positions in the image; pixel centres at integers."""
        zoom = max(self.side_px, min_side_px) / self.side_px
        return (positions_px + 0.5) / zoom - 0.5 + (self.left_px, self.top_px)


def hand_squares(arms: Arms, rule: SquareRule, image: np.ndarray) -> list[tuple[int, int, Square]]:
    """The square of every hand that may be in the image.

    Parameters
    ----------
    arms : Arms
    rule : SquareRule
    image : array, shape (height, width, 3)

    Returns
    -------
    list of tuple of (int, int, Square)
        Person, side (0 left, 1 right), square.
    """
    centres = arms.hands_px(rule)
    squares = []
    for person, side in np.argwhere(np.isfinite(centres).all(axis=-1) & np.isfinite(arms.scales_px)):
        # A square larger than the image would make the hand smaller than the whole image does.
        side_px = min(rule.side * arms.scales_px[person, side], max(image.shape[:2]))
        square = Square.around(centres[person, side], side_px)
        if square.overlaps(image):
            squares.append((int(person), int(side), square))
    return squares


def squares_along(image: np.ndarray) -> list[Square]:
    """Squares along an oblong image, as wide as its short side, overlapping by at least half.

    Examples
    --------
    >>> [(square.left_px, square.side_px) for square in squares_along(np.zeros((100, 200, 3)))]
    [(0, 100), (50, 100), (100, 100)]
    >>> squares_along(np.zeros((100, 140, 3)))
    []
    """
    height, width = image.shape[:2]
    side, length = min(height, width), max(height, width)
    if length < MIN_OBLONG * side:
        return []
    steps = int(np.ceil(2 * (length - side) / side)) + 1
    starts = np.linspace(0, length - side, steps).round().astype(int).tolist()
    return [Square(0, start, side) if height > width else Square(start, 0, side) for start in starts]
