"""Shared libraries that the environment's wheels load and do not bring.

The list is held against the wheels' own word by `tests/test_system_libraries.py`.
`python -m hicp_lib.system_libraries` prints the Debian packages that are missing. It imports
nothing but the standard library: it runs before anything else can.
"""

from __future__ import annotations

import ctypes
import sys

DEBIAN_PACKAGES = {
    "libEGL.so.1": "libegl1",  # Open3D, MediaPipe
    "libGL.so.1": "libgl1",  # Open3D
    "libGLESv2.so.2": "libgles2",  # MediaPipe
    "libX11.so.6": "libx11-6",  # Open3D
    "libgomp.so.1": "libgomp1",  # Pinocchio
    "libidn2.so.0": "libidn2-0",  # Open3D
    "libudev.so.1": "libudev1",  # Open3D
    "libusb-1.0.so.0": "libusb-1.0-0",  # Open3D
}


def missing_packages() -> list[str]:
    """Debian packages of the libraries that cannot be loaded; empty on other systems than Linux."""
    if sys.platform != "linux":
        return []
    return [package for library, package in DEBIAN_PACKAGES.items() if not _loads(library)]


def _loads(library: str) -> bool:
    try:
        ctypes.CDLL(library)
    except OSError:
        return False
    return True


if __name__ == "__main__":
    print(" ".join(missing_packages()))
