"""From heat maps and part affinity fields to people: peaks, limb scores, assembly.

After OpenPose (Cao et al., "OpenPose: Realtime multi-person 2D pose estimation using part
affinity fields", TPAMI 2021) and the defaults of its released program. Plain NumPy on any
`PartModel`; positions are in pixels of the network's input, pixel centres at integers, where
cell i of a map with stride s covers pixels s i ... s i + s - 1.

It differs from OpenPose in two ways, on purpose (`hicp_lib.detectors.openpose.released` does not). OpenPose
enlarges the maps to input size and takes a centroid around each maximum; here the maximum is found in the map
itself and refined with the parabola through the logarithms of its neighbours, which is exact for the
Gaussians that the maps are trained on, and cheaper. And two people are merged when a limb joins them and they
have no part in common.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import cv2
import numpy as np

from hicp_lib.core.datafiles import DATA_DIR
from hicp_lib.core.files import read_json


@dataclass(frozen=True)
class PartModel:
    """The parts a network finds and the limbs it knows.

    Attributes
    ----------
    convention : str
        Key of `hicp_lib.core.keypoints.TO_HALPE` for its parts.
    n_parts : int
        Number of heat maps used (without the background map).
    pairs : array, shape (n_pairs, 2)
        Parts (from, to) of each limb, in the order they are connected.
    fields : array, shape (n_pairs, 2)
        Channels of the limb's affinity field (x, y).
    completing : frozenset of int
        Limbs that may complete a person but never start one (ear to shoulder).
    uncounted : frozenset of int
        Parts that do not count towards the minimum number of parts of a person.
    """

    convention: str
    n_parts: int
    pairs: np.ndarray
    fields: np.ndarray
    completing: frozenset[int] = frozenset()
    uncounted: frozenset[int] = frozenset()

    @classmethod
    def of(cls, convention: str) -> PartModel:
        """The model of one of OpenPose's networks, by the name of its keypoints (`data/keypoints.json`)."""
        row = read_json(DATA_DIR / "keypoints.json")["openpose_parts"][convention]
        pairs, fields = np.array(row["pairs"]), np.array(row["fields"])
        completing, uncounted = frozenset(row["completing"]), frozenset(row["uncounted"])
        return cls(convention, row["n_parts"], pairs, fields, completing, uncounted)


@dataclass(frozen=True)
class PafOptions:
    """Thresholds, with the defaults of OpenPose's program.

    Attributes
    ----------
    min_peak : float
        Minimum heat map value of a part.
    min_sample : float
        Minimum projection of the field onto the limb for a sample to agree.
    min_agreement : float
        Minimum fraction of samples that agree.
    min_parts : int
        Minimum number of parts of a person.
    min_score : float
        Minimum of (sum of part and limb scores) / (number of parts) of a person.
    """

    min_peak: float = 0.05
    min_sample: float = 0.05
    min_agreement: float = 0.95
    min_parts: int = 3
    min_score: float = 0.4


@dataclass
class Person:
    """Peaks of one person by part, the sum of the counted scores (here of limbs) and their number."""

    peaks: dict[int, int] = field(default_factory=dict)
    score: float = 0.0
    n_scores: int = 0


# Peaks at its start and end, by their row, and how well the field supports it.
Limb = tuple[int, int, float]
# Values of maps (c, h, w) at input positions (..., 2), given the stride: (c, ...).
Sampler = Callable[[np.ndarray, np.ndarray, int], np.ndarray]

STRIDE = 8  # input pixels per cell of the networks' maps
MAX_PEAKS = 64
_LEAST = 1e-4
_LEAST_LENGTH_PX = _LEAST_SCORE = 1e-6
# Samples along a limb: so many in square root of its pixels, within limits.
_SAMPLES_PER_PX, _MIN_SAMPLES, _MAX_SAMPLES = 5, 5, 25
# Limbs shorter than the input's mean side over this have no room in the field.
_SIDE_OVER_SHORT_LIMB = 150


def find_peaks(heat_maps: np.ndarray, stride: int, min_peak: float) -> list[np.ndarray]:
    """Local maxima of each heat map, at most `MAX_PEAKS`, by decreasing value.

    Parameters
    ----------
    heat_maps : array, shape (n_parts, h, w)
    stride : int
        Input pixels per cell.
    min_peak : float
        Minimum value.

    Returns
    -------
    list of array
        One per part, shape (n, 3): x, y in input pixels, value.
    """
    cells = np.argwhere(_is_maximum(heat_maps) & (heat_maps > min_peak))
    part, row, column = cells.T
    logs = np.pad(np.log(np.maximum(heat_maps, _LEAST)), ((0, 0), (1, 1), (1, 1)), constant_values=np.nan)

    def beside(dy: int, dx: int) -> np.ndarray:
        return logs[part, row + 1 + dy, column + 1 + dx]

    x = column + _vertex(beside(0, -1), beside(0, 0), beside(0, 1))
    y = row + _vertex(beside(-1, 0), beside(0, 0), beside(1, 0))
    value = heat_maps[part, row, column]
    peaks = np.stack([(x + 0.5) * stride - 0.5, (y + 0.5) * stride - 0.5, value], axis=1)
    order = np.argsort(-value, kind="stable")
    return [peaks[order[part[order] == index]][:MAX_PEAKS] for index in range(len(heat_maps))]


_BEFORE = np.array([[1, 1, 1], [1, 0, 0], [0, 0, 0]], np.uint8)  # a cell's neighbours, row by row


def _is_maximum(maps: np.ndarray) -> np.ndarray:
    """Cells above their eight neighbours; of a plateau of equal cells, one remains."""
    before, after = (np.stack([cv2.dilate(one, of) for one in maps]) for of in (_BEFORE, _BEFORE[::-1, ::-1]))
    return (maps > before) & (maps >= after)


def _vertex(before: np.ndarray, middle: np.ndarray, after: np.ndarray) -> np.ndarray:
    """Vertex of the parabola through values at -1, 0, 1; 0 where a neighbour is missing (NaN)."""
    curvature = before - 2 * middle + after
    with np.errstate(invalid="ignore", divide="ignore"):
        shift = 0.5 * (before - after) / curvature
    return np.clip(np.where(np.isfinite(shift), shift, 0.0), -0.5, 0.5)


def limb_scores(
    limb_field: np.ndarray,
    starts: np.ndarray,
    ends: np.ndarray,
    stride: int,
    options: PafOptions,
    sample: Sampler | None = None,
) -> np.ndarray:
    """How well an affinity field supports a limb between every start and every end.

    The field is sampled along the straight line, 5 to 25 times by its length, and projected on
    the line's direction; the score is the mean of the samples that agree, if enough do.

    Parameters
    ----------
    limb_field : array, shape (2, h, w)
        X and y component.
    starts : array, shape (n, 2) or (n, 3)
    ends : array, shape (m, 2) or (m, 3)
        Positions in input pixels first.
    stride : int
        Input pixels per cell.
    options : PafOptions
        Thresholds.
    sample : callable, optional
        How the field is interpolated between cells; bilinearly if None.

    Returns
    -------
    array, shape (n, m)
        0 where there is no limb.
    """
    start, end = starts[:, None, :2], ends[None, :, :2]
    vector = end - start
    length = np.linalg.norm(vector, axis=-1)
    direction = vector / np.maximum(length, 1e-9)[..., None]
    n_samples = np.round(np.sqrt(_SAMPLES_PER_PX * np.abs(vector).max(axis=-1)))
    n_samples = np.clip(n_samples, _MIN_SAMPLES, _MAX_SAMPLES)
    step = np.arange(_MAX_SAMPLES)
    taken = step < n_samples[..., None]
    along = start[..., None, :] + vector[..., None, :] * (step / n_samples[..., None])[..., None]
    projected = np.einsum("cijk,ijc->ijk", (sample or _sample)(limb_field, along, stride), direction)
    agree = taken & (projected > options.min_sample)
    count = agree.sum(axis=-1)
    mean = np.where(agree, projected, 0).sum(axis=-1) / np.maximum(count, 1)
    # For nearly coinciding points the field has no samples; OpenPose lets them just pass.
    short_px = np.sqrt(limb_field[0].size) * stride / _SIDE_OVER_SHORT_LIMB
    is_short = (length > _LEAST_LENGTH_PX) & (length < short_px)
    weak = np.where(is_short, options.min_peak + _LEAST_SCORE, 0.0)
    return np.where(count > options.min_agreement * n_samples, mean, weak)


def _sample(maps: np.ndarray, positions_px: np.ndarray, stride: int) -> np.ndarray:
    """Bilinear samples of maps (c, h, w) at input positions (..., 2): (c, ...); clamped at the border."""
    limit = np.array([maps.shape[2], maps.shape[1]]) - 1
    cell = np.clip((positions_px + 0.5) / stride - 0.5, 0, limit)
    low = np.minimum(cell.astype(int), np.maximum(limit - 1, 0))
    high = np.minimum(low + 1, limit)
    (fx, fy), (x0, y0), (x1, y1) = (np.moveaxis(part, -1, 0) for part in (cell - low, low, high))
    top = maps[:, y0, x0] * (1 - fx) + maps[:, y0, x1] * fx
    bottom = maps[:, y1, x0] * (1 - fx) + maps[:, y1, x1] * fx
    return top * (1 - fy) + bottom * fy


def connect(scores: np.ndarray) -> list[Limb]:
    """Limbs chosen greedily by decreasing score, of equal ones the last first; each end is used once."""
    limbs, free_start, free_end = [], set(range(scores.shape[0])), set(range(scores.shape[1]))
    for flat in np.argsort(scores, axis=None, kind="stable")[::-1]:
        start, end = divmod(int(flat), scores.shape[1])
        if scores[start, end] <= _LEAST_SCORE:
            break
        if start in free_start and end in free_end:
            limbs.append((start, end, float(scores[start, end])))
            free_start.remove(start)
            free_end.remove(end)
    return limbs


def assemble(
    heat_maps: np.ndarray, fields: np.ndarray, model: PartModel, stride: int, options: PafOptions
) -> tuple[np.ndarray, np.ndarray]:
    """People in the maps of one image.

    Parameters
    ----------
    heat_maps : array, shape (n_parts, h, w)
        In [0, 1].
    fields : array, shape (n_fields, h, w)
    model : PartModel
        What the maps mean.
    stride : int
        Input pixels per cell.
    options : PafOptions
        Thresholds.

    Returns
    -------
    parts : array, shape (n_people, n_parts, 3)
        x, y in input pixels, score; NaN, NaN, 0 if missing.
    scores : array, shape (n_people,)
        (sum of part and limb scores) / (parts + limbs).
    """
    peaks = find_peaks(heat_maps, stride, options.min_peak)
    people: list[Person] = []
    for index, limbs in enumerate(find_limbs(peaks, fields, model, stride, options)):
        a, b = model.pairs[index].tolist()
        for start, end, score in limbs:
            _join(people, (a, start), (b, end), score, index in model.completing)
    return _keep(people, peaks, model, options)


def find_limbs(
    peaks: list[np.ndarray],
    fields: np.ndarray,
    model: PartModel,
    stride: int,
    options: PafOptions,
    sample: Sampler | None = None,
) -> list[list[Limb]]:
    """Limbs of each pair.

    Parameters
    ----------
    peaks : list of array
        Of each part, as `find_peaks` gives them.
    fields : array, shape (n_fields, h, w)
    model : PartModel
    stride : int
        Input pixels per cell.
    options : PafOptions
    sample : callable, optional
        As of `limb_scores`.
    """
    pairs = zip(model.pairs, model.fields, strict=True)
    limbs = ((fields[at], peaks[a], peaks[b]) for (a, b), at in pairs)
    return [connect(limb_scores(*limb, stride, options, sample)) for limb in limbs]


def part_rows(person: dict[int, int], peaks: list[np.ndarray]) -> np.ndarray:
    """A person's parts (n_parts, 3) as in `peaks`, from the row of each part's; NaN, NaN, 0 if missing."""
    missing = (np.nan, np.nan, 0.0)
    return np.array([peaks[part][person[part]] if part in person else missing for part in range(len(peaks))])


def _join(
    people: list[Person], a: tuple[int, int], b: tuple[int, int], score: float, completing: bool
) -> None:
    """Add the limb between peak `a` and peak `b` (part, index) to the people found so far."""
    with_a = next((person for person in people if person.peaks.get(a[0]) == a[1]), None)
    with_b = next((person for person in people if person.peaks.get(b[0]) == b[1]), None)
    person = with_a or with_b
    if person is None:
        if completing:
            return
        person = Person()
        people.append(person)
    elif with_b is not None and with_b is not person:
        if person.peaks.keys() & with_b.peaks.keys():
            return
        person.peaks.update(with_b.peaks)
        person.score += with_b.score
        person.n_scores += with_b.n_scores
        people[:] = [other for other in people if other is not with_b]
    for part, peak in (a, b):
        if person.peaks.setdefault(part, peak) != peak:
            return
    person.score += score
    person.n_scores += 1


def _keep(
    people: list[Person], peaks: list[np.ndarray], model: PartModel, options: PafOptions
) -> tuple[np.ndarray, np.ndarray]:
    parts, scores = [], []
    for person in people:
        rows = part_rows(person.peaks, peaks)
        total = rows[:, 2].sum() + person.score
        n_counted = len(person.peaks.keys() - model.uncounted)
        if n_counted >= options.min_parts and total / len(person.peaks) >= options.min_score:
            parts.append(rows)
            scores.append(total / (len(person.peaks) + person.n_scores))
    return np.array(parts).reshape(-1, model.n_parts, 3), np.array(scores)
