"""A working folder full of modules that are called as others are, and that tell when they are imported."""

from __future__ import annotations

from pathlib import Path

NAMES = (
    "papermill", "jupyter_book", "multiprocessing", "ezc3d", "resource", "numpy", "random", "onnxruntime",
    "cv2", "sitecustomize", "ipykernel_launcher", "IPython", "sphinx", "pip", "mediapipe", "open3d", "pandas",
    "json", "threading", "hicp_lib", "ipython_config", "conf",
)  # fmt: skip


def fill(folder: Path) -> Path:
    """Put the modules into a folder; the file that is there when one of them was imported."""
    marker = folder.parent / "imported"
    folder.mkdir(exist_ok=True)
    for name in NAMES:
        (folder / f"{name}.py").write_text(f"open({str(marker)!r}, 'a').write({name + ' '!r})\n")
    return marker
