"""Shared libraries that the environment's wheels load but do not contain.

`tests/cli/test_system_libraries.py` compares the list with the wheels' own shared objects.
`python -m hicp_lib.cli.system_libraries` prints the Debian packages that are missing. It imports
nothing but the standard library: it runs before anything else can.
"""

import ctypes
import sys
from importlib.util import find_spec

LIBRARIES = {
    "libEGL.so.1": ("libegl1", {"mediapipe", "open3d"}),
    "libGL.so.1": ("libgl1", {"open3d"}),
    "libGLESv2.so.2": ("libgles2", {"mediapipe"}),
    "libX11.so.6": ("libx11-6", {"open3d"}),
    "libgomp.so.1": ("libgomp1", {"pinocchio"}),
    "libidn2.so.0": ("libidn2-0", {"open3d"}),
    "libudev.so.1": ("libudev1", {"open3d", "pyrealsense2"}),
    "libusb-1.0.so.0": ("libusb-1.0-0", {"open3d", "pyrealsense2"}),
}
"""Each library's package in Debian, and the Python packages that cannot be imported without it."""


def missing_packages() -> list[str]:
    """Debian packages of libraries that installed packages need and that cannot be loaded; on Linux only."""
    if sys.platform != "linux":
        return []
    return [
        package
        for library, (package, needed_by) in LIBRARIES.items()
        if any(map(find_spec, needed_by)) and not _loads(library)
    ]


def _loads(library: str) -> bool:
    try:
        ctypes.CDLL(library)
    except OSError:
        return False
    return True


if __name__ == "__main__":
    print(" ".join(missing_packages()))
