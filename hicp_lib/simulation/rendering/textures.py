"""Procedural textures: periodic tiles with mip levels, sampled at metres.

A tile holds mixing weights or a height, not colours: a scene chooses the colours, so one
tile serves every paint, wood and cloth. Tiles are made once per process from fixed seeds.
"""

from collections.abc import Callable

import cv2
import numpy as np
from scipy import fft

from hicp_lib.core.memo import memoised
from hicp_lib.simulation.rendering.raycast import place

_REMAP_COLUMNS = 8192  # OpenCV's remap takes no array longer than 32767


Tile = tuple[np.ndarray, float]
Pattern = Callable[..., Tile]
"""Returns one period, (size, size[, channels]), with size a power of two, and its width in metres."""


def sample(
    pattern: Pattern, uv_m: np.ndarray, footprint_m: np.ndarray | float, *numbers: float
) -> np.ndarray:
    """Sample a pattern bilinearly, blurred to the footprint.

    Parameters
    ----------
    pattern : callable
        A pattern of this module.
    uv_m : array, shape (2, n)
    footprint_m : float or array, shape (n,)
        How many metres of surface one pixel sees.
    *numbers : float
        Parameters of the pattern.

    Returns
    -------
    array, shape (channels, n), dtype float32

    Examples
    --------
    >>> where = np.array([[0.0, 0.0], [0.1, 0.6]], np.float32)
    >>> sample(stripes, where, 0.001, 0.5)
    array([[1., 0.]], dtype=float32)
    """
    levels, width_m = _texture(pattern, *numbers)
    texel_m = width_m / (levels[0].shape[0] - 1)
    level = np.log2(np.maximum(np.asarray(footprint_m, np.float32) / texel_m, 1e-6))
    level = np.clip(np.rint(level), 0, len(levels) - 1).astype(np.int8)
    if level.ndim == 0 or level.min() == level.max():
        return _lookup(levels[int(level.flat[0])], width_m, uv_m)
    result = np.empty((levels[0].shape[2], uv_m.shape[1]), np.float32)
    for number in np.flatnonzero(np.bincount(level)).tolist():
        rows = np.flatnonzero(level == number)
        place(result, rows, _lookup(levels[number], width_m, uv_m.take(rows, axis=1)))
    return result


def _lookup(tile: np.ndarray, width_m: float, uv_m: np.ndarray) -> np.ndarray:
    size, channels = tile.shape[0] - 1, tile.shape[2]
    n = uv_m.shape[1]
    rows = -(-n // _REMAP_COLUMNS)
    columns = -(-n // rows)
    xy = np.zeros((2, rows * columns), np.float32)
    scaled = uv_m * np.float32(1 / width_m)
    xy[:, :n] = (scaled - np.floor(scaled)) * np.float32(size)
    maps = xy.reshape(2, rows, columns)
    found = cv2.remap(tile, maps[0], maps[1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return np.ascontiguousarray(found.reshape(rows * columns, channels)[:n].T)


@memoised()
def _texture(pattern: Pattern, *numbers: float) -> tuple[list[np.ndarray], float]:
    """A pattern's mip levels, (size + 1, size + 1, channels) float32, and its width in metres.

    Each level is half as large as the one before; its last row and column repeat the first.
    """
    period, width_m = pattern(*numbers)
    tile: np.ndarray = np.atleast_3d(period).astype(np.float32)
    levels = []
    while True:
        levels.append(np.ascontiguousarray(np.pad(tile, ((0, 1), (0, 1), (0, 0)), mode="wrap")))
        if tile.shape[0] <= 2:
            return levels, width_m
        tile = (tile[::2, ::2] + tile[1::2, ::2] + tile[::2, 1::2] + tile[1::2, 1::2]) / 4


_SIZE = 512


def noise(
    rng: np.random.Generator,
    slope: float,
    low: float,
    stretch: tuple[float, float] = (1, 1),
    size: int = _SIZE,
) -> np.ndarray:
    """Periodic Gaussian noise.

    Parameters
    ----------
    rng : numpy.random.Generator
    slope : float
        The amplitude spectrum falls as frequency ** -slope.
    low : float
        Below so many cycles per tile it is flat.
    stretch : tuple of float, optional
        How much longer features are along rows and columns.
    size : int, optional
        Of the tile, in texels.

    Returns
    -------
    array, shape (size, size), dtype float32
        Mean 0, standard deviation 1.

    Examples
    --------
    >>> field = noise(np.random.default_rng(0), slope=1.5, low=2, size=64)
    >>> abs(float(field.mean())) < 1e-6, round(float(field.std()), 3)
    (True, 1.0)
    """
    rows, columns = fft.fftfreq(size, 1 / size), fft.rfftfreq(size, 1 / size)
    radius = np.hypot(rows[:, None] * stretch[0], columns * stretch[1]).astype(np.float32)
    amplitude = np.maximum(radius, low) ** np.float32(-slope)
    amplitude[0, 0] = 0
    spectrum = fft.rfft2(rng.standard_normal((size, size)).astype(np.float32))
    field = fft.irfft2(spectrum * amplitude, (size, size))
    return field / field.std()


def _rng(number: int) -> np.random.Generator:
    return np.random.default_rng([20220, number])


def _grid() -> np.ndarray:
    """Coordinates v and u of texels, from 0 to 1, (2, `_SIZE`, `_SIZE`)."""
    return np.mgrid[:_SIZE, :_SIZE] / _SIZE


def _from_whole(x: np.ndarray) -> np.ndarray:
    """Distance from the nearest whole number."""
    return np.abs(np.mod(x + 0.5, 1) - 0.5)


def cloud() -> Tile:
    """Smooth noise of all sizes, two independent channels; 1 m."""
    return np.dstack([noise(_rng(k), 1.6, 2) for k in (1, 2)]), 1.0


def planks() -> Tile:
    """Wooden boards: (light to dark, gap between boards); 1.2 m, boards along v."""
    boards, (v, u) = 8, _grid()
    board = np.floor(u * boards).astype(int)
    end = np.mod(v + _rng(4).random(boards)[board], 1)
    tone = _rng(5).random((boards, 2))[board, (end > 0.5).astype(int)]
    gap = np.minimum(
        _from_whole(u * boards) / boards, np.minimum(np.abs(end - 0.5), np.minimum(end, 1 - end))
    )
    fibre = noise(_rng(6), 1.1, 4, (14, 1))
    return np.dstack([np.clip(0.5 * tone + 0.25 + 0.12 * fibre, 0, 1), gap < 0.0025]), 1.2


def wood() -> Tile:
    """Sawn wood, light to dark, grain along v; 0.8 m."""
    rings, fibre = noise(_rng(7), 1.7, 1, (10, 1)), noise(_rng(8), 0.8, 8, (20, 1))
    return np.clip(0.5 + 0.28 * np.sin(4 * rings) + 0.12 * fibre, 0, 1), 0.8


def tiles() -> Tile:
    """Square tiles: (tone, grout); four tiles across, 1.2 m."""
    v, u = _grid() * 4
    tone = _rng(9).random((4, 4))[v.astype(int), u.astype(int)]
    edge = np.minimum(_from_whole(u), _from_whole(v))
    return np.dstack([0.35 + 0.3 * tone + 0.08 * noise(_rng(10), 1.2, 3), edge < 0.012]), 1.2


def carpet() -> Tile:
    """Short pile, light to dark; 0.6 m."""
    return 0.5 + 0.13 * noise(_rng(11), 0.4, 40) + 0.05 * noise(_rng(12), 1.2, 2), 0.6


def plaster() -> Tile:
    """Painted wall: slight unevenness, light to dark; 1.6 m."""
    return 0.5 + 0.12 * noise(_rng(13), 1.4, 2) + 0.12 * noise(_rng(14), 0.7, 40), 1.6


def bricks() -> Tile:
    """Brick wall: (tone, mortar); 1 m, 4 bricks by 12 courses."""
    across, courses, (v, u) = 4, 12, _grid()
    course = np.floor(v * courses)
    x = np.mod(u * across + 0.5 * np.mod(course, 2), across)
    tone = _rng(15).random((courses, across))[course.astype(int), x.astype(int) % across]
    edge, rough = (
        np.minimum(_from_whole(x) / across, _from_whole(v * courses) / courses),
        noise(_rng(16), 1.0, 8),
    )
    mortar = edge < 0.006 + 0.001 * rough
    return np.dstack([np.clip(tone * 0.7 + 0.15 + 0.1 * rough, 0, 1), mortar]), 1.0


def weave() -> Tile:
    """Woven or knitted cloth seen close, around 0; 0.06 m at a tenth of a millimetre."""
    v, u = _grid() * 2 * np.pi * 60  # threads
    cross = np.sin(u) * np.sin(v) + 0.5 * np.sin(u + v)
    return 0.6 * cross + 0.5 * noise(_rng(17), 0.8, 10), 0.06


def wrinkles() -> Tile:
    """Height of small folds in cloth, around 0, two channels (soft, creased); 0.5 m, folds run along v."""
    soft = noise(_rng(18), 2.6, 3, (2.0, 1))
    ridges = [1 - 2 * np.abs(noise(_rng(k), 2.2, 2, (1.5, 1))) for k in (19, 20)]
    creased = cv2.GaussianBlur(np.tile(np.minimum(*ridges), (3, 3)), (0, 0), 3)[512:1024, 512:1024]
    return np.dstack([soft, creased]), 0.5


def strands() -> Tile:
    """Hair: brightness of single strands and locks, around 0; 0.1 m, strands along v."""
    return 0.6 * noise(_rng(21), 0.2, 30, (60, 1)) + 0.6 * noise(_rng(22), 1.0, 5, (25, 1)), 0.1


def skin() -> Tile:
    """Skin: (blotches of redness, pores and lines, freckles 0..1), the first two around 0; 0.12 m."""
    freckles = np.clip(noise(_rng(25), 0.8, 40) - 1.7, 0, 1)
    return np.dstack([noise(_rng(23), 1.8, 4), noise(_rng(24), 0.5, 60), freckles]), 0.12


def stripes(duty: float) -> Tile:
    """Stripes along u, 0 and 1; one period per metre (scale the coordinates)."""
    profile = ((np.arange(256) + 0.5) / 256 < duty).astype(np.float32)
    return np.repeat(profile[:, None], 256, axis=1), 1.0


def checks(kind: int) -> Tile:
    """Gingham, tartan or window pane: weights of (second, third) colour; one period per metre."""
    t = (np.arange(256) + 0.5) / 256
    lines = 0.55 * (np.abs(t - 0.3) < 0.025) + 0.4 * (np.abs(t - 0.65) < 0.02)
    tartan = (np.abs(t - 0.3) < 0.17) | (np.abs(t - 0.8) < 0.04)
    pane = 0.9 * (np.abs(t - 0.5) < 0.03)
    band, line = ((t < 0.5, 0 * t), (tartan, lines), (0 * t, pane))[kind]
    weights = [np.add.outer(0.5 * band, 0.5 * band), np.maximum.outer(line, line)]
    return np.dstack(weights[::-1] if kind == 2 else weights), 1.0


def dots(radius: float) -> Tile:
    """Dots on a staggered grid, 0 and 1; one period per metre."""
    v, u = (np.mgrid[:256, :256] + 0.5) / 256
    distance = [np.hypot(np.mod(u - x, 1) - 0.5, np.mod(v - x, 1) - 0.5) for x in (0, 0.5)]
    return np.minimum(*distance) < radius, 1.0


def blobs(number: int) -> Tile:
    """Flower-, leaf- or camouflage-like blobs: weights of (second, third) colour; one period per metre."""
    slope, low = ((2.5, 4), (1.2, 9), (3.5, 2))[number % 3]
    a, b = (noise(_rng(30 + 2 * number + k), slope, low, size=256) for k in (0, 1))
    return np.dstack([a > 0.6, (b > 0.8) & (a <= 0.6)]), 1.0


def prints(number: int) -> Tile:
    """What is printed on a shirt's chest: weights of (second, third) colour; one print per 0.3 m."""
    rng, size = _rng(60 + number), 256
    ink = np.zeros((2, size, size), np.uint8)
    kind = number % 4
    if kind in (0, 3):
        letters = "".join(rng.choice(list("ABCDEFGHKLMNOPRSTUVXZ0123456789"), rng.integers(2, 6)))
        scale = 9.0 / len(letters)
        thickness = int(3 * scale) + 1
        (w, h), _ = cv2.getTextSize(letters, cv2.FONT_HERSHEY_DUPLEX, scale, thickness)
        origin = ((size - w) // 2, (size + h) // 2)
        cv2.putText(ink[0], letters, origin, cv2.FONT_HERSHEY_DUPLEX, scale, 255, thickness, cv2.LINE_AA)
    if kind in (1, 3):
        cv2.circle(ink[1], (128, 128), 110 if kind == 1 else 124, 255, -1 if kind == 1 else 6, cv2.LINE_AA)
    if kind == 1:
        for _ in range(5):
            cv2.fillPoly(ink[0], [rng.normal(128, 45, (3, 2)).astype(np.int32)], 255, cv2.LINE_AA)
    if kind == 2:
        for row in range(4):
            cv2.rectangle(ink[row % 2], (40, 50 + 42 * row), (216, 72 + 42 * row), 255, -1)
    weights = np.moveaxis(ink, 0, -1).astype(np.float32) / 255
    weights[..., 1] *= 1 - weights[..., 0]
    return weights, 0.3


def picture(number: int) -> Tile:
    """A picture to hang on a wall, three channels in [0, 1]; one per metre."""
    rng = _rng(100 + number)
    tile = np.dstack([noise(rng, 2.2, 1.5, size=256) for _ in range(3)]) * 0.15 + rng.random(3)
    tile = np.ascontiguousarray(np.clip(255 * tile, 0, 255).astype(np.uint8))
    for _ in range(rng.integers(3, 12)):
        colour = tuple(int(c) for c in rng.integers(0, 256, 3))
        centre, axes = rng.integers(0, 256, 2), rng.integers(8, 90, 2)
        turn_deg = float(rng.integers(180))
        cv2.ellipse(tile, centre.tolist(), axes.tolist(), turn_deg, 0, 360, colour, -1, cv2.LINE_AA)
    blurred = 0.6 * tile + 0.4 * cv2.GaussianBlur(tile, (0, 0), 6)
    return np.clip(blurred / 255, 0.02, 0.95), 1.0
