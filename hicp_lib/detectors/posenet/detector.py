"""PoseNet on MobileNetV1, bottom-up: all people in an image (Papandreou et al., "PersonLab", ECCV 2018).

The image is centred in the network's square input. `tools/bake_tfjs.py` made its file.

The network gives, on a grid of cells, a heat map of each keypoint, the offset from a cell to the keypoint
near it, and along each edge of the tree the displacement from a parent to its child and back. The highest
cell not yet assigned is the root of the next person, whose other keypoints are reached along the
displacements.
"""

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Unpack

import cv2
import numpy as np

from hicp_lib.core.detections import Detections
from hicp_lib.detectors.onnx.fitting import Regions
from hicp_lib.detectors.onnx.session import RunOptions, open_committed

STRIDE_PX = 16


# Parent and child, indices of COCO's 17, in the order of the displacements' channels.
EDGES = (
    (0, 1), (1, 3), (0, 2), (2, 4), (0, 5), (5, 7), (7, 9), (5, 11), (11, 13), (13, 15),
    (0, 6), (6, 8), (8, 10), (6, 12), (12, 14), (14, 16),
)  # fmt: skip
_N_PARTS, _N_REFINEMENTS = 17, 2


@dataclass(frozen=True)
class DecodingRule:
    """Thresholds of the decoding, as published with the network.

    Attributes
    ----------
    max_people : int
    min_root_score : float
        Minimum score of a person's first cell.
    same_part_px : float
        A keypoint this close to an earlier person's keypoint of the same kind belongs to that person, in
        input pixels.
    """

    max_people: int = 5
    min_root_score: float = 0.5
    same_part_px: float = 20.0


@dataclass(frozen=True)
class Maps:
    """The network's outputs on (h, w) cells that are `STRIDE_PX` apart.

    Attributes
    ----------
    heat : array, shape (17, h, w)
        Scores in [0, 1].
    offsets_px : array, shape (17, h, w, 2)
        x, y from the cell to the keypoint.
    to_child_px, to_parent_px : array, shape (16, h, w, 2)
        x, y along each of `EDGES`.
    """

    heat: np.ndarray
    offsets_px: np.ndarray
    to_child_px: np.ndarray
    to_parent_px: np.ndarray

    def cell(self, x_px: float, y_px: float) -> tuple[int, int]:
        """Row and column of the cell nearest to a position."""
        height, width = self.heat.shape[1:]
        row, column = math.floor(y_px / STRIDE_PX + 0.5), math.floor(x_px / STRIDE_PX + 0.5)
        return min(max(row, 0), height - 1), min(max(column, 0), width - 1)

    def keypoint(self, part: int, cell: tuple[int, int]) -> tuple[float, float]:
        """x and y of a keypoint near a cell."""
        off_x, off_y = self.offsets_px[(part, *cell)].tolist()
        return cell[1] * STRIDE_PX + off_x, cell[0] * STRIDE_PX + off_y


def decode(maps: Maps, rule: DecodingRule) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """People in the maps, in decreasing order of their roots' scores.

    Parameters
    ----------
    maps : Maps
    rule : DecodingRule

    Returns
    -------
    positions_px : array, shape (n, 17, 2)
        In input pixels.
    scores : array, shape (n, 17)
    person_scores : array, shape (n,)
        Sum of the scores of keypoints that no earlier person has, divided by 17.
    """
    people: list[np.ndarray] = []
    person_scores: list[float] = []
    for part, *cell in _roots(maps.heat, rule.min_root_score).tolist():
        if len(people) == rule.max_people:
            break
        if _is_taken(people, part, maps.keypoint(part, (cell[0], cell[1])), rule):
            continue
        person = _walk(maps, part, (cell[0], cell[1]))
        is_new = [not _is_taken(people, k, person[k, :2].tolist(), rule) for k in range(_N_PARTS)]
        person_scores.append(person[is_new, 2].sum() / _N_PARTS)
        people.append(person)
    rows = np.array(people).reshape(-1, _N_PARTS, 3)
    return rows[..., :2], rows[..., 2], np.array(person_scores)


def _roots(heat: np.ndarray, least: float) -> np.ndarray:
    """Part, row and column (n, 3) of cells not exceeded by their eight neighbours, highest first."""
    window = np.ones((3, 3), np.uint8)
    highest = np.stack([cv2.dilate(one, window, borderType=cv2.BORDER_REPLICATE) for one in heat])
    rows = np.argwhere((heat >= least) & (heat >= highest))
    return rows[np.argsort(-heat[tuple(rows.T)], kind="stable")]


def _is_taken(people: list[np.ndarray], part: int, position_px: Sequence[float], rule: DecodingRule) -> bool:
    return any(math.dist(person[part, :2], position_px) <= rule.same_part_px for person in people)


def _walk(maps: Maps, root: int, cell: tuple[int, int]) -> np.ndarray:
    """x, y, score (17, 3) of the person with this root: up the tree from it, then down to all others.

    With Python floats, since arrays of two would take most of the decoding's time.
    """
    found = {root: (*maps.keypoint(root, cell), float(maps.heat[(root, *cell)]))}
    up = [(edge, child, parent, maps.to_parent_px) for edge, (parent, child) in enumerate(EDGES)]
    down = [(edge, parent, child, maps.to_child_px) for edge, (parent, child) in enumerate(EDGES)]
    for edge, source, target, steps_px in [*up[::-1], *down]:
        if source in found and target not in found:
            x_px, y_px, _ = found[source]
            step_x, step_y = steps_px[(edge, *maps.cell(x_px, y_px))].tolist()
            at = x_px + step_x, y_px + step_y
            for _ in range(_N_REFINEMENTS):
                at = maps.keypoint(target, maps.cell(*at))
            found[target] = (*at, float(maps.heat[(target, *maps.cell(*at))]))
    return np.array([found[part] for part in range(_N_PARTS)])


class PoseNetMobileNet:
    """PoseNet (MobileNetV1): 17 body points of all people in the image.

    Parameters
    ----------
    max_people : int
    min_root_score : float
        See `hicp_lib.detectors.posenet.detector.DecodingRule`.
    **run : object
        See `hicp_lib.detectors.onnx.session.RunOptions`.
    """

    name = "posenet"

    def __init__(self, max_people: int = 5, min_root_score: float = 0.5, **run: Unpack[RunOptions]) -> None:
        self._model = open_committed(f"{self.name}.onnx", **run)
        self._rule = DecodingRule(max_people, min_root_score)
        self.settings = {**asdict(self._rule), "opencv": cv2.__version__, "model": self._model.settings}

    def detect(self, image: np.ndarray) -> Detections:
        """Find people in an RGB image, shape (height, width, 3), uint8."""
        size_px = self._model.size_px
        whole = Regions.whole(image, size_px)
        (square,) = whole.crop(image, size_px)
        positions_px, scores, person_scores = decode(self.maps(square), self._rule)
        in_image_px = whole.to_image_px(positions_px.reshape(1, -1, 2), size_px).reshape(positions_px.shape)
        return Detections.of_parts(in_image_px, scores, person_scores, "coco17")

    def maps(self, square: np.ndarray) -> Maps:
        """Run the network on an RGB square of its input's side."""
        blob = cv2.dnn.blobFromImage(square, 1 / 127.5, mean=(127.5, 127.5, 127.5))
        outputs = self._model.run_named(blob)
        # In the outputs, all y components come first, then all x.
        names = ("displacement_fwd", "displacement_bwd", "offset")
        paired = (outputs[name].reshape(2, -1, *outputs[name].shape[2:]) for name in names)
        to_child, to_parent, offsets = (np.moveaxis(of_both[::-1], 0, -1) for of_both in paired)
        heat = 1 / (1 + np.exp(-outputs["heatmap"][0]))
        return Maps(heat, offsets, to_child, to_parent)
