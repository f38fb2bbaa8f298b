"""Shared libraries that Open3D loads and a bare Linux lacks.

`python -m hicp_lib.system_libraries` prints the Debian packages that are missing. It
imports nothing but the standard library: it runs before anything else can.
"""

from __future__ import annotations

import ctypes
import sys

DEBIAN_PACKAGES = {
    "libEGL.so.1": "libegl1",
    "libGL.so.1": "libgl1",
    "libgomp.so.1": "libgomp1",
    "libusb-1.0.so.0": "libusb-1.0-0",
    "libX11.so.6": "libx11-6",
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
