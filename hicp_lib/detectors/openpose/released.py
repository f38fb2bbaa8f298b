"""Input, peaks and affinity fields as OpenPose's released program has them.

The input is BGR, value / 256 - 0.5, aspect ratio kept. The maps are enlarged to the size of the input; a peak
is the centroid of the positive values within 3 pixels of a local maximum, and fields are read at the nearest
pixel. `paf` finds peaks in the small maps, which is far cheaper and as good; this module is for the original
networks, whose results should equal the program's (constants and rules: its `net` folder, version 1.7).

The program measures image pixels from their corners: it adds half an image pixel to a peak before it reads
the fields, and keeps it in its results. Here the fields are read at the same places (`offset_px`), but
results have pixel centres at integers, as everywhere in this library.

`join_as_released` goes from limbs to people as that program does (the build for processors, version 1.7).
Its rules are followed exactly, even where they look odd, to get the same people:

- A part without any partner in the image is a person of one part until a limb includes it.
- A limb is added to the first person who has its first end, and overwrites that person's part at its second
  end; otherwise it starts a new person. People are never merged. (The build for graphics cards, which sorts
  the limbs of all kinds together, merges.)
- Limbs from shoulder to ear complete people but start none; neither their scores nor their parts count.
- A person's score is the sum over its parts and limbs, divided by their possible number.
- Feet do not count towards the minimum number of parts, and a person with feet needs more than four other
  parts; if nobody is left, this rule is dropped.

`hicp_lib.detectors.openpose.paf` uses its own, simpler rules.
"""

from functools import partial

import cv2
import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from hicp_lib.detectors.onnx.fitting import Letterbox
from hicp_lib.detectors.openpose.paf import Limb, PafOptions, PartModel, Person, find_limbs, part_rows

_MAX_PEAKS = 127
_REACH_PX = 3
# Wider images are scaled down, and the height padded with black.
_MAX_ASPECT = 16 / 9


def fit(image: np.ndarray, height_px: int, width_px: int | None = None) -> Letterbox:
    """Fit an image into the input like OpenPose's program: aspect ratio kept, black right and below.

    The width follows the image's aspect ratio, rounded to a multiple of 16 and at most 16 / 9 of the height.
    The centres of the first and last pixels coincide.

    Parameters
    ----------
    image : array, shape (height, width, 3), dtype uint8
    height_px : int
    width_px : int, optional
        If the network accepts no other.

    Examples
    --------
    >>> [fit(np.zeros((h, w, 3), np.uint8), 368).pixels.shape[1] for w, h in ((640, 429), (1280, 425))]
    [544, 656]
    """
    size = np.array(image.shape[1::-1])
    proportion = min(_MAX_ASPECT, size[0] / size[1])
    net_size = np.array([width_px or 16 * int(height_px * proportion / 16 + 0.5) or 16, height_px])
    zoom = ((net_size - 1) / np.maximum(size - 1, 1)).min()
    flags = cv2.INTER_CUBIC if zoom > 1 else cv2.INTER_AREA
    pixels = cv2.warpAffine(image, np.eye(2, 3) * zoom, tuple(net_size.tolist()), flags=flags)
    covered = np.floor(zoom * size + 0.5)
    back = (np.maximum(size - 1, 1) / np.maximum(covered - 1, 1)).min()
    return Letterbox(pixels, np.full(2, 1 / back), (0.0, 0.0), 0.0)


def feed(pixels: np.ndarray) -> np.ndarray:
    """The network's input, shape (1, 3, height, width), for an RGB image."""
    return cv2.dnn.blobFromImage(pixels, 1 / 256, mean=(128.0,) * 3, swapRB=True)


def assemble_released(
    heat_maps: np.ndarray,
    fields: np.ndarray,
    model: PartModel,
    stride: int,
    options: PafOptions,
    offset_px: float = 0.0,
) -> tuple[np.ndarray, np.ndarray]:
    """People in the maps of one image, as `hicp_lib.detectors.openpose.paf.assemble` gives them.

    Parameters
    ----------
    heat_maps : array, shape (n_parts, h, w)
    fields : array, shape (n_fields, h, w)
    model : PartModel
    stride : int
        Input pixels per cell.
    options : PafOptions
    offset_px : float
        Half an image pixel, in pixels of the network's input.

    Returns
    -------
    parts : array, shape (n_people, n_parts, 3)
        x, y in input pixels, score; NaN, NaN, 0 if missing.
    scores : array, shape (n_people,)
        As in the program, see `hicp_lib.detectors.openpose.released.join_as_released`.
    """
    heat_maps, fields = enlarge(heat_maps, stride), enlarge(fields, stride)
    peaks = [centroid_peaks(heat_map, options.min_peak) for heat_map in heat_maps]
    sample = partial(_nearest, offset_px=offset_px)
    return join_as_released(peaks, find_limbs(peaks, fields, model, 1, options, sample), model, options)


def enlarge(maps: np.ndarray, factor: int) -> np.ndarray:
    """Maps (n, h, w), n > 0, enlarged bicubically; pixel centres at integers in both."""
    size = maps.shape[2] * factor, maps.shape[1] * factor
    large = [cv2.resize(map_, size, interpolation=cv2.INTER_CUBIC) for map_ in maps.astype(np.float32)]
    return np.stack(large)


def centroid_peaks(heat_map: np.ndarray, min_peak: float) -> np.ndarray:
    """Local maxima of an enlarged map (h, w) above `min_peak`: rows (n, 3) of x, y in pixels and value.

    There are none at the border itself; one pixel inside, where enlarging produces pairs of equal values,
    equal neighbours are allowed.
    """
    # Pixels below their neighbours cannot be peaks: this leaves few to examine closely.
    highest = cv2.dilate(heat_map, np.ones((3, 3), np.uint8))
    rows, columns = cells = np.nonzero((heat_map > min_peak) & (heat_map >= highest))
    value = heat_map[rows, columns]
    around = _windows(heat_map, rows, columns, 1, min_peak).reshape(-1, 9)
    others = np.delete(around, 4, axis=1)
    to_border = np.minimum(np.stack(cells), np.array(heat_map.shape)[:, None] - 1 - cells).T
    inner, ring = (to_border > 1).all(axis=1), (to_border == 1).any(axis=1)
    is_peak = inner & (value[:, None] > others).all(axis=1) | ring & (value[:, None] >= others).all(axis=1)
    rows, columns, value = (part[is_peak][:_MAX_PEAKS] for part in (rows, columns, value))
    weights = np.maximum(_windows(heat_map, rows, columns, _REACH_PX, 0.0), 0).astype(float)
    step = np.arange(-_REACH_PX, _REACH_PX + 1)
    total = weights.sum(axis=(1, 2))
    x = columns + (weights.sum(axis=1) @ step) / total
    y = rows + (weights.sum(axis=2) @ step) / total
    return np.stack([x, y, value], axis=1)


def _windows(
    values: np.ndarray, rows: np.ndarray, columns: np.ndarray, reach: int, fill: float
) -> np.ndarray:
    """Squares of `values` (h, w) around some cells, `fill` beyond the border: (n, 2 reach + 1, same)."""
    padded = np.pad(values, reach, constant_values=fill)
    return sliding_window_view(padded, (2 * reach + 1, 2 * reach + 1))[rows, columns]


def _nearest(maps: np.ndarray, positions_px: np.ndarray, stride: int, offset_px: float = 0.0) -> np.ndarray:
    limit = np.array([maps.shape[2], maps.shape[1]]) - 1
    cells = np.clip(np.floor((positions_px + offset_px) / stride + 0.5).astype(int), 0, limit)
    x, y = np.moveaxis(cells, -1, 0)
    return maps[:, y, x]


_MOST_BESIDE_FEET = 4


def join_as_released(
    peaks: list[np.ndarray], limbs: list[list[Limb]], model: PartModel, options: PafOptions
) -> tuple[np.ndarray, np.ndarray]:
    """People from the peaks of each part and the limbs of each pair.

    Parameters
    ----------
    peaks : list of array
        Of each part, shape (n, 3): x, y, value.
    limbs : list of list of tuple
        Of each pair, as `hicp_lib.detectors.openpose.paf.connect` gives them.
    model : PartModel
    options : PafOptions

    Returns
    -------
    parts : array, shape (n_people, n_parts, 3)
        x, y as in `peaks`, score; NaN, NaN, 0 if missing.
    scores : array, shape (n_people,)
    """
    people: list[Person] = []
    for index, (a, b) in enumerate(model.pairs.tolist()):
        if not (len(peaks[a]) and len(peaks[b])):
            _begin_alone(people, a if len(peaks[a]) else b, peaks)
        elif index in model.completing:
            _complete(people, a, b, limbs[index])
        else:
            _extend(people, a, b, limbs[index], peaks)
    kept = _keep(people, model.uncounted, options) or _keep(people, frozenset(), options)
    parts = np.array([part_rows(person.peaks, peaks) for person in kept]).reshape(-1, model.n_parts, 3)
    n_terms = model.n_parts + len(model.pairs)
    return parts, np.array([person.score / n_terms for person in kept])


def _begin_alone(people: list[Person], part: int, peaks: list[np.ndarray]) -> None:
    taken = {person.peaks.get(part) for person in people}
    new = [(peak, value) for peak, value in enumerate(peaks[part][:, 2]) if peak not in taken]
    people += [Person({part: peak}, value, 1) for peak, value in new]


def _complete(people: list[Person], a: int, b: int, limbs: list[Limb]) -> None:
    for start, end, _ in limbs:
        for person in people:
            if person.peaks.get(a) == start:
                person.peaks.setdefault(b, end)
            elif person.peaks.get(b) == end:
                person.peaks.setdefault(a, start)


def _extend(people: list[Person], a: int, b: int, limbs: list[Limb], peaks: list[np.ndarray]) -> None:
    for start, end, score in limbs:
        person = next((person for person in people if person.peaks.get(a) == start), None)
        if person is None:
            person = Person({a: start}, peaks[a][start, 2], 1)
            people.append(person)
        person.peaks[b] = end
        person.n_scores += 1
        person.score += peaks[b][end, 2] + score


def _keep(people: list[Person], uncounted: frozenset[int], options: PafOptions) -> list[Person]:
    kept = []
    for person in people:
        n_uncounted = len(person.peaks.keys() & uncounted)
        n = person.n_scores - n_uncounted
        if n_uncounted and n <= _MOST_BESIDE_FEET:
            continue
        if n >= options.min_parts and person.score / n >= options.min_score:
            kept.append(person)
    return kept
