"""The list of system libraries is what the environment's shared objects ask for, no more and no less."""

from __future__ import annotations

import re
import site
import sys
import sysconfig
from collections import defaultdict
from dataclasses import dataclass
from pathlib import Path

import pytest
from elftools.elf.elffile import ELFFile

from hicp_lib.cli.system_libraries import LIBRARIES

pytestmark = pytest.mark.skipif(
    sys.platform != "linux" or sysconfig.get_platform() != "linux-x86_64",
    reason="the list is of Debian's packages, and was derived on x86-64",
)

# Debian's apt and Python stand on these: no system with Python is without them.
ALWAYS_THERE = re.compile(r"ld-linux-x86-64\.so\.2|lib(c|m|dl|pthread|rt|util|gcc_s|stdc\+\+)\.so\.\d+")
# What is asked for and not needed, by the start of its name.
OPTIONAL = {
    "libquadmath.so.0": "of Boost's charconv and locale, which Pinocchio does not load",
    "libtensorflow_framework": "of Open3D's operations for TensorFlow, which the study does not use",
    "libtorch_cpu": "of Open3D's operations for PyTorch, which the study does not use",
    "libc10": "of Open3D's operations for PyTorch, which the study does not use",
    "libamdhip64": "of librealsense on AMD's GPUs",
    "libcuda.so": "of librealsense on NVIDIA's GPUs",
    "libGL.so": "of Open3D's window: another name of libGL.so.1",
    "libGLES": "of Open3D's window, for OpenGL ES 1, under two names",
    "libOpenGL": "of Open3D's window: another name for what libGL.so.1 has",
    "libGLX": "of Open3D's window; comes with libgl1",
    "libOSMesa": "of Open3D's window, drawn in software",
    "libX": "of Open3D's window: X11's extensions; nothing opens a window",
    "libdecor-0": "of Open3D's window: its frame",
    "libwayland-": "of windows on Wayland; matplotlib only asks whether there is a display",
    "libxkbcommon": "of Open3D's window: its keyboard",
    "libvulkan": "of Open3D's window on Vulkan",
    "libk4a": "of Azure Kinect cameras, which Open3D can read",
    "libcrypto.so": "names that OpenSSL, linked in, tries for plug-ins",
    "libssl.so": "names that OpenSSL, linked in, tries for plug-ins",
    "libmkl_": "variants of Intel's MKL for some processors; linked into Open3D",
    "libiomp5": "Intel's OpenMP, looked for by TBB for its number of threads only",
    "libirml": "of TBB: shares a processor between programs of Intel's",
    "libtbb": "of TBB: memory and binding to processors of several sockets",
    "libmemkind": "of TBB: memory of several kinds",
    "libittnotify": "Intel's profiler",
    "libOpenCL": "graphics processors; OpenCV and MediaPipe compute on the processor",
    "libLiteRt": "graphics processors, for MediaPipe",
    "libonnxruntime_providers_": "accelerators for ONNX Runtime; it computes on the processor",
    "libfribidi": "scripts from right to left in Pillow's text",
    "libhdfs": "Hadoop's files, which Arrow can read",
    "libjvm": "Java, for Hadoop's files",
    "libnuma": "memory of several sockets, for Arrow's client of S3",
}  # fmt: skip
# A name that stands alone between two zero bytes is one to be opened by `dlopen`.
_OPENED = re.compile(rb"\0(lib[\w+.-]+\.so(?:\.\d+)*)(?=\0)")


@dataclass(frozen=True)
class Wanted:
    """Libraries that the environment does not bring: what links to each, and what may open it, by package."""

    needed: dict[str, set[str]]
    opened: dict[str, set[str]]


@pytest.fixture(scope="module")
def wanted() -> Wanted:
    needed, opened, brought = defaultdict(set), defaultdict(set), set()
    for path in (path for folder in site.getsitepackages() for path in Path(folder).rglob("*.so*")):
        brought.add(path.name)
        if path.is_symlink() or not path.is_file() or path.suffix == ".debug":
            continue
        with path.open("rb") as file:
            if file.read(4) == b"\x7fELF":
                elf, package = ELFFile(file), str(path).rpartition("/site-packages/")[2].split("/")[0]
                brought.update(_dynamic(elf, "DT_SONAME", "soname"))
                for names, into in ((_dynamic(elf, "DT_NEEDED", "needed"), needed), (_opened(elf), opened)):
                    for name in names:
                        into[name].add(package)
    return Wanted(
        *({name: by for name, by in all_.items() if name not in brought} for all_ in (needed, opened))
    )


def _dynamic(elf: ELFFile, tag: str, attribute: str) -> set[str]:
    section = elf.get_section_by_name(".dynamic")
    return {getattr(entry, attribute) for entry in section.iter_tags(tag)} if section else set()


def _opened(elf: ELFFile) -> set[str]:
    section = elf.get_section_by_name(".rodata")
    return {name.decode() for name in _OPENED.findall(section.data())} if section else set()


def test_every_library_is_listed_or_optional_for_a_reason(wanted):
    unknown = {
        name: by
        for name, by in (wanted.needed | wanted.opened).items()
        if name not in LIBRARIES and not ALWAYS_THERE.fullmatch(name) and not name.startswith(tuple(OPTIONAL))
    }
    assert not unknown, "add them to system_libraries.LIBRARIES, or to OPTIONAL with the reason"


def test_the_list_names_who_needs_each_and_nothing_that_nobody_asks_for(wanted):
    assert {name: by for name, (_, by) in LIBRARIES.items()} == {
        name: wanted.needed[name] for name in LIBRARIES
    }
    names = [*wanted.needed, *wanted.opened]
    assert not [start for start in OPTIONAL if not any(name.startswith(start) for name in names)]
