"""From light to an 8-bit image: lens, exposure, noise and tone curve of a consumer camera."""

from dataclasses import dataclass

import cv2
import numpy as np

from hicp_lib.core.memo import memoised

_TILE_PX = 1536
_N_TONES = 4096  # in the table of the tone curve
_LUMINANCE = np.array([0.2126, 0.7152, 0.0722], np.float32)  # of linear sRGB


@dataclass(frozen=True)
class Sensor:
    """A consumer camera's settings.

    Attributes
    ----------
    white_balance : array, shape (3,)
        Gains of the linear RGB channels.
    exposure : float
        Multiplies the automatic exposure.
    blur_px : float
        Standard deviation of lens and demosaicking blur.
    vignette : float
        Loss of light in the corners, 0 to 1.
    shot_noise, read_noise : float
        Standard deviations for full-scale light and for black, of full scale.
    contrast : float
        Steepness of the tone curve, 1 neutral.
    saturation : float
        1 neutral.
    """

    white_balance: np.ndarray
    exposure: float = 1.0
    blur_px: float = 0.5
    vignette: float = 0.2
    shot_noise: float = 0.015
    read_noise: float = 0.003
    contrast: float = 1.1
    saturation: float = 1.0


def expose(
    radiance: np.ndarray, sensor: Sensor, rng: np.random.Generator, meter: np.ndarray | None = None
) -> np.ndarray:
    """Develop linear light into an image.

    Parameters
    ----------
    radiance : array, shape (height, width, 3), dtype float32
        Linear RGB.
    sensor : Sensor
    rng : numpy.random.Generator
        Of the noise.
    meter : array of bool, shape (height, width), optional
        Pixels that count most for the exposure (people: cameras look for faces).

    Returns
    -------
    array, shape (height, width, 3), dtype uint8
        RGB.

    Raises
    ------
    ValueError
        For an image larger than 1536 pixels.

    Examples
    --------
    >>> grey = np.full((48, 64, 3), 0.7, np.float32)  # whatever the light, the exposure makes it middle grey
    >>> image = expose(grey, Sensor(np.ones(3), vignette=0.0), np.random.default_rng(0))
    >>> 110 < image.mean() < 130
    np.True_
    """
    height, width = radiance.shape[:2]
    gains = sensor.white_balance * _auto_exposure(radiance, meter) * sensor.exposure
    y = np.linspace(-1, 1, height, dtype=np.float32)[:, None]
    x = np.linspace(-1, 1, width, dtype=np.float32)[None, :]
    lens = 1 - np.float32(sensor.vignette * 0.5) * (x * x + y * y)
    light = cv2.GaussianBlur(radiance, (0, 0), max(sensor.blur_px, 0.2))
    light = cv2.multiply(light, cv2.merge([lens * np.float32(gain) for gain in gains]))
    variance = light * np.float32(sensor.shot_noise**2)
    variance += np.float32(sensor.read_noise**2)
    light = cv2.add(light, cv2.multiply(cv2.sqrt(variance), _noise(height, width, rng)))
    saturate = sensor.saturation * np.eye(3) + (1 - sensor.saturation) * _LUMINANCE
    return _tone(cv2.transform(light, saturate.astype(np.float32)), sensor.contrast)


@memoised()
def _noise_tile() -> np.ndarray:
    """Noise of brightness and, blurred by demosaicking, of colour; (`_TILE_PX`, `_TILE_PX`, 3)."""
    rng = np.random.default_rng(_TILE_PX)
    colour = cv2.GaussianBlur(rng.standard_normal((_TILE_PX, _TILE_PX, 3), np.float32), (0, 0), 0.8)
    return 0.8 * rng.standard_normal((_TILE_PX, _TILE_PX, 1), np.float32) + 1.2 * colour


def _noise(height: int, width: int, rng: np.random.Generator) -> np.ndarray:
    """A random piece of the noise tile, (height, width, 3); new noise would cost more than shading."""
    tile = _noise_tile()
    row, column = (rng.integers(0, _TILE_PX - size + 1) for size in (height, width))
    return cv2.flip(tile[row : row + height, column : column + width], int(rng.integers(-1, 2)))


def _auto_exposure(radiance: np.ndarray, meter: np.ndarray | None) -> float:
    grey = radiance[::4, ::4] @ _LUMINANCE
    log = np.log(np.maximum(grey, 1e-4))
    level = log.mean()
    if meter is not None and meter[::4, ::4].any():
        level = 0.5 * level + 0.5 * log[meter[::4, ::4]].mean()
    return float(0.20 / np.exp(level))


def _tone(light: np.ndarray, contrast: float) -> np.ndarray:
    """Linear light to sRGB with a shoulder that rolls highlights off, through a table."""
    x = np.linspace(0, 4, _N_TONES)
    # Keeps middle grey, rolls off to white at 4.
    shoulder = np.clip(1.156 * x * (1 + x / 36) / (1 + 0.9 * x), 0, 1)
    srgb = np.where(shoulder <= 0.0031308, 12.92 * shoulder, 1.055 * shoulder ** (1 / 2.4) - 0.055)
    curved = 0.5 + 0.5 * np.tanh(contrast * 2 * (srgb - 0.46)) / np.tanh(contrast)
    table = np.clip(255 * (0.35 * curved + 0.65 * srgb) + 0.5, 0, 255).astype(np.uint8)
    flat = light.reshape(len(light), -1)
    levels = cv2.addWeighted(flat, (_N_TONES - 1) / 4, flat, 0, 0, dtype=cv2.CV_16U)  # negative ones are 0
    return table.take(levels, mode="clip").reshape(light.shape)
