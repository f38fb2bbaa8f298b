"""librealsense's own software device: two streams whose cameras are apart and turned."""

from __future__ import annotations

import time

import numpy as np
import pyrealsense2 as rs

COLOR_PX, DEPTH_PX = (40, 30), (32, 24)
START_S, PERIOD_S = 1_700_000_000.0, 1 / 30
PLANE_UNITS, UNIT_M = 3000, 0.0005  # a wall 1.5 m before the depth camera
# Turned by 3, -5 and 10 degrees about x, y and z: depth's coordinates to colour's.
R_COLOR_DEPTH = np.array([
    [0.98106026, -0.17790219, -0.07662635], [0.17298739, 0.98266573, -0.06665532],
    [0.08715574, 0.05213680, 0.99482930],
])  # fmt: skip
T_COLOR_DEPTH_M = [0.15, 0.02, -0.05]
COEFFICIENTS = [-0.05, 0.06, 0.001, -0.002, -0.02]


def _stream(kind, uid: int, pixels, bytes_per_px: int, size, focal_px: float, model, coefficients):
    intrinsics, stream = rs.intrinsics(), rs.video_stream()
    intrinsics.width, intrinsics.height = size
    intrinsics.fx, intrinsics.fy = focal_px, focal_px + 1
    intrinsics.ppx, intrinsics.ppy = size[0] / 2 - 0.5, size[1] / 2
    intrinsics.model, intrinsics.coeffs = model, coefficients
    stream.type, stream.index, stream.uid, stream.fps, stream.bpp, stream.fmt = (
        kind,
        0,
        uid,
        30,
        bytes_per_px,
        pixels,
    )
    stream.width, stream.height = size
    stream.intrinsics = intrinsics
    return stream


class SoftwareCamera:
    """A camera to be fed with frames."""

    def __init__(self, coefficients=(0.0,) * 5):
        self.device = rs.software_device()
        self.device.register_info(rs.camera_info.name, "Software")
        self.sensors = [self.device.add_sensor(name) for name in ("Stereo Module", "RGB Camera")]
        plain, inverse = rs.distortion.brown_conrady, rs.distortion.inverse_brown_conrady
        depth = _stream(rs.stream.depth, 0, rs.format.z16, 2, DEPTH_PX, 30.0, plain, [0.0] * 5)
        color = _stream(rs.stream.color, 1, rs.format.rgb8, 3, COLOR_PX, 35.0, inverse, list(coefficients))
        self.profiles = [of.add_video_stream(s) for of, s in zip(self.sensors, (depth, color), strict=True)]
        self.sensors[0].add_read_only_option(rs.option.depth_units, UNIT_M)
        extrinsics = rs.extrinsics()
        extrinsics.rotation, extrinsics.translation = list(R_COLOR_DEPTH.T.ravel()), T_COLOR_DEPTH_M
        self.profiles[0].register_extrinsics_to(self.profiles[1], extrinsics)

    def feed(self, n: int, lost: tuple[int, ...] = ()) -> None:
        """`n` frames less those lost, depth 1 ms before colour; they arrive when they do."""
        for k in sorted({*range(n)} - {*lost}):
            depth = np.full(DEPTH_PX[::-1], PLANE_UNITS, np.uint16)
            color = np.full((*COLOR_PX[::-1], 3), (200, 20, 10 * k), np.uint8)
            for sensor, profile, pixels, early_s in zip(
                self.sensors, self.profiles, (depth, color), (0.001, 0.0), strict=True
            ):
                frame = rs.software_video_frame()
                frame.pixels, frame.stride, frame.bpp = pixels, pixels.strides[0], pixels.strides[1]
                frame.timestamp = (START_S + k * PERIOD_S - early_s) * 1000
                frame.domain, frame.frame_number = rs.timestamp_domain.global_time, k + 1
                frame.profile = profile.as_video_stream_profile()
                if early_s:
                    frame.depth_units = UNIT_M
                sensor.on_video_frame(frame)
            time.sleep(0.02)
