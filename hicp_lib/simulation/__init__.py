"""Rendered people, rooms and sensors, and the experiments that are simulated with them."""

from hicp_lib.core.extras import require

require("render", "open3d", "scipy")
