"""The paper's proposal: one detector for the body and another for the hands.

`combined:BODY+HANDS` searches for hands at the body's wrists, and in the whole image:

1. the body detector runs once;
2. the hand model is run on a square around each forearm's end (`hand_squares`), enlarged when small, and
   optionally on its mirror image, where the model makes different errors;
3. it is run on the whole image and, if that is oblong, on overlapping squares along it: a hand model's input
   is a square, in which a long image makes hands small. These runs find the hands of bodies that were not
   found or whose arms are wrong, and every further sighting makes a hand's points more precise;
4. all sightings are assigned to arms (`arbitration`): one hand per arm, left and right by the body's anatomy.

Hands that no arm takes become instances of their own if they are out of every body's reach; otherwise they
contradict a body's arms and are dropped. If no hand is found, an arm keeps the hand of the body detector, if
there is one.
"""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict
from functools import partial
from typing import Any

import numpy as np

from hicp_lib.core.detections import Detections, Detector
from hicp_lib.core.errors import InputError
from hicp_lib.detectors.combined import arbitration
from hicp_lib.detectors.combined.arbitration import ArbitrationRule, Hands
from hicp_lib.detectors.combined.hand_squares import Arms, Square, SquareRule, hand_squares, squares_along

LOOKS = ("wrists", "mirrored", "image", "along")
_Looks = Callable[[], list[Hands]]


class Combined:
    """A body detector and a hand detector combined.

    Parameters
    ----------
    body, hands : Detector
        Ready detectors; `hands` gives hand points in the Halpe layout.
    looks : str
        Where hands are searched for, joined by +: "wrists" (a square at each forearm's end), "mirrored" (that
        square mirrored), "image" (the whole of it), "along" (squares along an oblong image).
    arbitrate : bool
        Apply the rules of `arbitration`; if not, a wrist takes the hand with the highest score in its own
        squares, and further hands go to the nearest free wrist.
    agreement : bool
        Scores of assigned hands grow with the number and agreement of their sightings; if not, they are the
        hand model's.
    min_side_px : int
        Smaller squares are enlarged to this.
    side_by_side : bool
        Run the hand model on the whole image while the body detector runs: lower latency if a processor is
        free, as needed on a robot.
    """

    def __init__(
        self,
        body: Detector,
        hands: Detector,
        looks: str = "wrists+image+along",
        arbitrate: bool = True,
        agreement: bool = True,
        min_side_px: int = 320,
        side_by_side: bool = False,
    ) -> None:
        self._thread = ThreadPoolExecutor(1) if side_by_side else None
        self._looks = looks.split("+")
        if not set(self._looks) <= set(LOOKS):
            raise InputError(f"looks {looks!r}: expected some of {', '.join(LOOKS)}, joined by +")
        self.name = f"combined:{body.name}+{hands.name}"
        self.parts: dict[str, Any] = {"body": body, "hands": hands}
        self._arbitrate, self._min_side_px = arbitrate, min_side_px
        self._squares = SquareRule()
        self._rule = ArbitrationRule() if agreement else ArbitrationRule(alone=0, scatter=0)
        self.takes_boxes = getattr(body, "takes_boxes", False)
        parts = self.parts.items()
        self.settings: dict[str, Any] = {kind: {"name": part.name, **part.settings} for kind, part in parts}
        self.settings |= {"looks": sorted(self._looks), "arbitrate": arbitrate, "min_side_px": min_side_px}
        self.settings |= {"squares": asdict(self._squares), "rule": asdict(self._rule)}

    def detect(self, image: np.ndarray, boxes_px: np.ndarray | None = None) -> Detections:
        """Find people in an RGB image, shape (height, width, 3), uint8."""
        elsewhere: _Looks = partial(self._elsewhere, image)
        if self._thread:
            elsewhere = self._thread.submit(elsewhere).result
        body = self.parts["body"]
        bodies = body.detect(image, boxes_px) if self.takes_boxes else body.detect(image)
        arms = Arms.of(bodies, self._squares)
        return (self._arbitrated if self._arbitrate else self._as_seen)(image, bodies, arms, elsewhere)

    def _arbitrated(self, image: np.ndarray, bodies: Detections, arms: Arms, elsewhere: _Looks) -> Detections:
        seen = [hands for _, _, hands in self._at_wrists(image, arms)] + elsewhere()
        hands = arbitration.merge_duplicates(Hands.concatenate(seen), self._rule)
        chosen = arbitration.assign(arbitration.distances(arms, hands, self._rule))
        strangers = hands.take(~self._within_reach(arms, hands))
        return arbitration.give_hands(bodies, hands, chosen).concatenate(arbitration.without_body(strangers))

    def _within_reach(self, arms: Arms, hands: Hands) -> np.ndarray:
        """Which hands (n,) are within reach of some body, judged by its shoulders and elbows only."""
        unknown = np.full_like(arms.wrists_px, np.nan)
        loose = Arms(unknown, unknown, arms.shoulders_px, arms.scales_px)
        reached = np.isfinite(arbitration.distances(loose, hands, self._rule))
        taken = np.isfinite(arbitration.distances(arms, hands, self._rule))
        return (reached | taken).any(axis=(0, 1))

    def _as_seen(self, image: np.ndarray, bodies: Detections, arms: Arms, elsewhere: _Looks) -> Detections:
        chosen = np.full((len(bodies), 2), -1)
        seen: list[Hands] = []
        for person, side, hands in self._at_wrists(image, arms):
            if len(hands) and chosen[person, side] < 0:
                chosen[person, side] = len(seen)
                seen.append(hands.take(hands.scores.mean(axis=1).argmax(keepdims=True)))
        hands = Hands.concatenate(seen + elsewhere())
        chosen = arbitration.nearest_first(arms.wrists_px, hands, chosen)
        rest = hands.take(np.setdiff1d(np.arange(len(hands)), chosen))
        return arbitration.give_hands(bodies, hands, chosen).concatenate(arbitration.without_body(rest))

    def _at_wrists(self, image: np.ndarray, arms: Arms) -> list[tuple[int, int, Hands]]:
        ways = [way == "mirrored" for way in ("wrists", "mirrored") if way in self._looks]
        return [
            (person, side, self._look(image, square, mirrored))
            for person, side, square in hand_squares(arms, self._squares, image)
            for mirrored in ways
        ]

    def _elsewhere(self, image: np.ndarray) -> list[Hands]:
        whole = [Hands.of(self.parts["hands"].detect(image))] if "image" in self._looks else []
        squares = squares_along(image) if "along" in self._looks else []
        return whole + [self._look(image, square) for square in squares]

    def _look(self, image: np.ndarray, square: Square, mirrored: bool = False) -> Hands:
        pixels = square.cut(image, self._min_side_px)
        shown = np.ascontiguousarray(pixels[:, ::-1]) if mirrored else pixels
        hands = Hands.of(self.parts["hands"].detect(shown))
        positions_px, sides = hands.keypoints_px, hands.sides
        if mirrored:
            positions_px, sides = (len(pixels) - 1, 0) + positions_px * (-1, 1), 1 - sides
        return Hands(square.to_image_px(positions_px, self._min_side_px), hands.scores, sides)
