"""A time-of-flight depth camera like Microsoft's Azure Kinect: errors of another kind than stereo's.

Light whose brightness is modulated comes back with a phase, 4 pi f z / c, and an amplitude, which falls with
the square of the distance and with the slope of the surface. A pixel sums what comes from all it covers, and
a little of what the lens scatters from all around: at outlines the sum has the phase of neither surface
(flying pixels), and near bright things depth leans towards theirs. Weak light is noisy, and too weak light
gives no depth.

Sources: Microsoft's hardware specification of the Azure Kinect DK for geometry, range and errors (random up
to 17 mm, systematic up to 11 mm and 0.1 % of the distance), which Tölgyessy et al. ("Evaluation of the Azure
Kinect", Sensors 2021) confirm; Hansard et al. ("Time-of-Flight Cameras", 2012) for the principle. Nothing in
this study is tuned on it.
"""

from dataclasses import dataclass

import cv2
import numpy as np

from hicp_lib.simulation.sensors.depth_camera import DepthCamera, Rng
from hicp_lib.simulation.sensors.depth_noise import correlated_noise

_LIGHT_M_S = 299_792_458.0
_LEAST_COSINE = 0.1


@dataclass(frozen=True, kw_only=True)
class TimeOfFlightCamera(DepthCamera):
    """Errors of a time-of-flight camera in addition to those of every depth camera; zero switches one off.

    Amplitudes are shares of that of a white surface 1 m away that faces the camera.

    Attributes
    ----------
    modulation_hz : float
    axial_noise_m : float
        Standard deviation at amplitude 1, more in proportion to 1 / amplitude.
    noise_px : int
        Side of the neighbourhood in which noise is correlated, odd.
    blur_px : float
        Standard deviation of the spot that a point's light makes.
    stray : float
        Share of the light that the lens scatters.
    stray_px : int
        Side of the square that it scatters over.
    wiggle_m : float
        Amplitude of the systematic error, with four periods per turn of the phase.
    least_amplitude : float
        Weaker light has no depth.
    reflectivity, hair_reflectivity : float
        Share of the infrared light that surfaces return.
    """

    modulation_hz: float = 100e6
    axial_noise_m: float = 0.0005
    noise_px: int = 3
    blur_px: float = 0.7
    stray: float = 0.02
    stray_px: int = 129
    wiggle_m: float = 0.003
    least_amplitude: float = 0.01
    reflectivity: float = 0.6
    hair_reflectivity: float = 0.1

    def measure(self, true_px: np.ndarray, hair: np.ndarray, first_column: int, rng: Rng) -> np.ndarray:
        """Depth by phase.

        Parameters
        ----------
        true_px : array, shape (h, w), dtype float32
        hair : array of bool, shape (h, w)
        first_column : int
        rng : numpy.random.Generator
            These as of `DepthCamera.measure`.

        Returns
        -------
        array, shape (h, w), dtype float32
        """
        depth_m = np.full(true_px.shape, np.nan, np.float32)
        np.divide(np.float32(self.focal_baseline), true_px, out=depth_m, where=true_px > 0)
        amplitude = np.where(hair, self.hair_reflectivity, self.reflectivity) * self._cosine(true_px)
        amplitude = np.nan_to_num(amplitude / depth_m**2)
        phase = np.nan_to_num(depth_m) * (4 * np.pi * self.modulation_hz / _LIGHT_M_S)
        own = np.stack([np.cos(phase), np.sin(phase)], axis=-1).astype(np.float32)
        light = self._scattered(own * amplitude[..., None].astype(np.float32))
        along, across = (own * light).sum(axis=-1), own[..., 0] * light[..., 1] - own[..., 1] * light[..., 0]
        received = np.hypot(along, across)
        measured_m = depth_m + np.arctan2(across, along) * (_LIGHT_M_S / (4 * np.pi * self.modulation_hz))
        measured_m += np.float32(self.wiggle_m) * np.sin(4 * phase)
        noise = correlated_noise(true_px.shape, self.noise_px, rng)
        measured_m += np.float32(self.axial_noise_m) * noise / np.maximum(received, 1e-6)
        return np.where(received >= self.least_amplitude, measured_m, np.nan).astype(np.float32)

    def _cosine(self, true_px: np.ndarray) -> np.ndarray:
        """Of the angle between the surface and the line of sight, (h, w), from how disparity changes."""
        slope = np.hypot(*np.gradient(true_px)) * np.float32(self.focal_px)
        return np.maximum(true_px / np.maximum(np.hypot(slope, true_px), 1e-6), _LEAST_COSINE)

    def _scattered(self, light: np.ndarray) -> np.ndarray:
        """Light (h, w, 2) after the lens."""
        sharp = cv2.GaussianBlur(light, (0, 0), self.blur_px) if self.blur_px else light
        return (1 - self.stray) * sharp + self.stray * cv2.blur(sharp, (self.stray_px, self.stray_px))


AZURE_KINECT = TimeOfFlightCamera(
    width_px=640, height_px=576, focal_px=504.0, baseline_m=0.032, colour_offset_m=-0.032,
    nearest_m=0.5, max_range_m=3.86,
)  # fmt: skip
"""The mode with the narrow field of view at full resolution, 640 x 576."""
