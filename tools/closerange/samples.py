"""Squares to train on: parts of rendered pictures around one person, changed at random, with exact truth.

Each square shows what a robot's camera, or a crop of HiCP, could show of one person: all of it, all but the
head, one part, or a hand, which is always a right one, since left ones are mirrored. Light, colours,
sharpness, noise, compression and occluding patches are changed at random, since rendered pictures have less
variety than photographs.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np

from hicp_lib.core.keypoints import COCO_17, HEAD, LEFT_HAND, N_KEYPOINTS, RIGHT_HAND, mirror
from hicp_lib.datasets.close import AIMS

from .frozen import SIDE_PX

VIEWS = {"whole": 0.4, "headless": 0.4, "part": 0.2}
"""Shares of the views of people."""
_LEAST_PX = 24  # of a view's longer side in the picture
_LEAST_POINTS = 4
_MIRROR = mirror("halpe136")


@dataclass(frozen=True)
class Sample:
    """A square and its truth.

    Attributes
    ----------
    square : array, shape (SIDE_PX, SIDE_PX, 3), dtype uint8
        RGB.
    keypoints_px : array, shape (136, 2), dtype float32
        In the square, pixel centres at integers; NaN where not in it.
    seen : array, shape (136,), dtype uint8
        0 not in the square, 1 hidden, 2 visible.
    view : str
        Of `VIEWS`, or "hand".
    """

    square: np.ndarray
    keypoints_px: np.ndarray
    seen: np.ndarray
    view: str


def draw_sample(
    rng: np.random.Generator, image: np.ndarray, keypoints_px: np.ndarray, visibility: np.ndarray,
    fillers: list[Callable[[], np.ndarray]], of_hand: bool = False,
) -> Sample | None:  # fmt: skip
    """A random square of a person, or of a hand.

    Parameters
    ----------
    rng : numpy.random.Generator
    image : array, shape (height, width, 3), dtype uint8
        RGB.
    keypoints_px : array, shape (136, 2)
    visibility : array, shape (136,)
        As of `hicp_lib.formats.annotations.Annotations`.
    fillers : list of callable
        Give pictures whose parts serve as occluders.
    of_hand : bool

    Returns
    -------
    Sample or None
        None if the view that was drawn shows too little of the person.
    """
    size_px = np.array(image.shape[1::-1])
    inside = (visibility > 0) & ((keypoints_px >= -0.5) & (keypoints_px < size_px - 0.5)).all(axis=1)
    view = "hand" if of_hand else str(rng.choice(list(VIEWS), p=list(VIEWS.values())))
    if of_hand:
        box, is_mirrored = _hand_view(rng, keypoints_px, inside, visibility)
    else:
        box, is_mirrored = _view(rng, view, keypoints_px, inside, size_px), rng.random() < 0.5
    if box is None:
        return None
    square, matrix = _warped(rng, image, box, view)
    points = keypoints_px @ matrix[:, :2].T + matrix[:, 2]
    shown = inside if view == "hand" else inside & _within(keypoints_px, box)
    within = shown & ((points >= -0.5) & (points < SIDE_PX - 0.5)).all(axis=1)
    seen = np.where(within, np.where(visibility >= 2, 2, 1), 0).astype(np.uint8)
    if (seen > 0).sum() < _LEAST_POINTS or not (seen == 2).any():
        return None
    if is_mirrored:
        square, points, seen = square[:, ::-1], points * [-1, 1] + [SIDE_PX - 1, 0], seen[_MIRROR]
        points = points[_MIRROR]
    square = np.ascontiguousarray(square)
    if rng.random() < 0.35:
        seen = _occlude(rng, square, points, seen, fillers)
    square = _photographed(rng, square)
    return Sample(square, np.where(seen[:, None] > 0, points, np.nan).astype(np.float32), seen, view)


def _view(
    rng: np.random.Generator, view: str, points: np.ndarray, inside: np.ndarray, size_px: np.ndarray
) -> np.ndarray | None:
    """Left, top, right, bottom of the part of the picture to show."""
    chosen = inside
    if view == "part":
        aim = AIMS[str(rng.choice(list(AIMS)))]
        chosen = inside & np.isin(np.arange(N_KEYPOINTS), aim)
    if chosen.sum() < _LEAST_POINTS:
        return None
    low, high = points[chosen].min(axis=0), points[chosen].max(axis=0)
    spread = (high - low).max()
    grow = rng.uniform(0.02, 0.12, 4) * spread if view != "part" else rng.uniform(0.05, 0.3, 4) * spread
    box = np.array([*(low - grow[:2]), *(high + grow[2:])])
    if view == "headless":
        if not (inside & np.isin(np.arange(N_KEYPOINTS), COCO_17[5:])).any():
            return None
        head = points[inside & np.isin(np.arange(N_KEYPOINTS), HEAD)]
        if len(head):
            box[1] = head[:, 1].max() + rng.uniform(0, 0.05) * spread
        box[1] += (rng.random() < 0.3) * rng.uniform(0, 0.4) * (box[3] - box[1])
    elif rng.random() < 0.25:  # cut at one side
        side, part = rng.integers(4), rng.uniform(0.1, 0.55)
        box[side] += (1 if side < 2 else -1) * part * (box[2 + side % 2] - box[side % 2])
    box = np.clip(box, 0, np.tile(size_px, 2))
    return box if (box[2:] - box[:2]).min() >= _LEAST_PX else None


def _within(points: np.ndarray, box: np.ndarray) -> np.ndarray:
    return ((points >= box[:2] - 0.5) & (points < box[2:] - 0.5)).all(axis=1)


def _hand_view(
    rng: np.random.Generator, points: np.ndarray, inside: np.ndarray, visibility: np.ndarray
) -> tuple[np.ndarray | None, bool]:
    """The part of the picture to show, and whether it is of a left hand."""
    hands = [of for of in (LEFT_HAND, RIGHT_HAND) if (inside & (visibility >= 2))[of].sum() >= _LEAST_POINTS]
    if not hands:
        return None, False
    of = hands[rng.integers(len(hands))]
    low, high = np.nanmin(points[of], axis=0), np.nanmax(points[of], axis=0)
    side = max((high - low).max(), 10) * rng.uniform(1.3, 3.0)
    centre = (low + high) / 2 + rng.uniform(-0.12, 0.12, 2) * side
    if side < _LEAST_PX:
        return None, False
    return np.array([*(centre - side / 2), *(centre + side / 2)]), of is LEFT_HAND


def _warped(
    rng: np.random.Generator, image: np.ndarray, box: np.ndarray, view: str
) -> tuple[np.ndarray, np.ndarray]:
    """The square of a box, and the affine map (2, 3) from the picture's pixels to the square's."""
    centre, side = (box[:2] + box[2:]) / 2, (box[2:] - box[:2]).max()
    free = view == "hand"  # a crop's borders are black, those of a hand's square are not
    angle = rng.normal(0, 0.35 if free else 0.12)
    scale = SIDE_PX / side * (1 if free else rng.uniform(0.85, 1.0))
    cos, sin = scale * np.cos(angle), scale * np.sin(angle)
    turn = np.array([[cos, -sin], [sin, cos]])
    matrix = np.column_stack([turn, (SIDE_PX - 1) / 2 - turn @ (centre - 0.5)])
    if not free:
        left, top, right, bottom = (int(v) for v in np.round(box))
        shown = np.zeros_like(image)
        shown[max(top, 0) : bottom, max(left, 0) : right] = image[max(top, 0) : bottom, max(left, 0) : right]
        image = shown
    return cv2.warpAffine(image, matrix, (SIDE_PX, SIDE_PX)), matrix


def _occlude(
    rng: np.random.Generator, square: np.ndarray, points: np.ndarray, seen: np.ndarray,
    fillers: list[Callable[[], np.ndarray]],
) -> np.ndarray:  # fmt: skip
    """Paste one or two patches of another picture; what they cover is hidden."""
    seen = seen.copy()
    for _ in range(rng.integers(1, 3)):
        filler = fillers[rng.integers(len(fillers))]()
        width, height = (rng.uniform(0.08, 0.35, 2) * SIDE_PX).astype(int)
        height, width = min(height, filler.shape[0] - 1), min(width, filler.shape[1] - 1)
        y, x = rng.integers(filler.shape[0] - height), rng.integers(filler.shape[1] - width)
        left, top = rng.integers(SIDE_PX - width), rng.integers(SIDE_PX - height)
        mask = np.zeros((height, width), np.uint8)
        cv2.ellipse(mask, (width // 2, height // 2), (width // 2, height // 2), 0, 0, 360, 1, -1)
        if rng.random() < 0.5:
            mask[:] = 1
        region = square[top : top + height, left : left + width]
        region[mask > 0] = filler[y : y + height, x : x + width][mask > 0]
        places = np.nan_to_num(points, nan=-9e3)
        at = np.round(places - [left, top]).astype(int)
        within = ((at >= 0) & (at < [width, height])).all(axis=1)
        covered = within.copy()
        covered[within] = mask[at[within, 1], at[within, 0]] > 0
        seen[covered & (seen == 2)] = 1
    return seen


def _photographed(rng: np.random.Generator, square: np.ndarray) -> np.ndarray:
    """Colours, light, sharpness, noise and compression at random."""
    pixels = square.astype(np.float32) / 255
    if rng.random() < 0.9:
        pixels = pixels ** np.exp(rng.normal(0, 0.3)) * np.exp(rng.normal(0, 0.2))
        pixels *= np.exp(rng.normal(0, 0.1, 3)).astype(np.float32)
        grey = pixels.mean(axis=2, keepdims=True)
        pixels = grey + (pixels - grey) * rng.uniform(0.2, 1.4)
        pixels = (pixels - 0.5) * rng.uniform(0.7, 1.3) + 0.5
    if rng.random() < 0.3:  # light from a side
        ramp = np.linspace(-1, 1, SIDE_PX, dtype=np.float32) * rng.normal(0, 0.35)
        pixels = pixels * (1 + (ramp[None, :, None] if rng.random() < 0.5 else ramp[:, None, None]))
    if rng.random() < 0.35:
        pixels = cv2.GaussianBlur(pixels, (0, 0), rng.uniform(0.4, 2.0))
    if rng.random() < 0.3:
        small = int(SIDE_PX * rng.uniform(0.25, 0.8))
        pixels = cv2.resize(cv2.resize(pixels, (small, small), interpolation=cv2.INTER_AREA), (SIDE_PX,) * 2)
    if rng.random() < 0.4:
        pixels = pixels + rng.normal(0, rng.uniform(0.005, 0.05), pixels.shape).astype(np.float32)
    square = (np.clip(pixels, 0, 1) * 255 + 0.5).astype(np.uint8)
    if rng.random() < 0.4:
        quality = [cv2.IMWRITE_JPEG_QUALITY, int(rng.integers(25, 90))]
        square = cv2.imdecode(cv2.imencode(".jpg", square, quality)[1], cv2.IMREAD_COLOR)
    return square
