"""Draw the floors of the library, as the import contract of `pyproject.toml` has them.

    python tools/draw_floors.py

writes `book/images/floors.svg`. It stands alone on light and dark pages.
"""

from __future__ import annotations

import tomllib
from html import escape
from pathlib import Path

CHECKOUT = Path(__file__).resolve().parents[1]
DRAWING = "book/images/floors.svg"
HOLDS = {
    "cli": "the command hicp, doctor",
    "report": "notebooks run, pages filled, the book built",
    "study": "this paper: pages, tables, plots, claims",
    "experiments": "simulated recordings, doses, avoidance",
    "simulation": "people, rooms, renderer, sensors",
    "inspection": "what a file is; detections drawn over pictures",
    "evaluation": "AP, statistics, failures, calibration, space",
    "mocap": "clocks, registration, reprojection",
    "lifting": "keypoints from the image into space",
    "recordings": "RGB-D recordings: read, write, check, import",
    "datasets": "crops: Basic, Headless, Close; visibility",
    "detectors": "detectors, their weights, their cached results",
    "robot": "kinematics, skin, controller, loop",
    "formats": "annotations, results and files of other tools",
    "core": "keypoints, detections, camera, OKS, cache, errors",
}
COLOURS = {"study": ("#f6d9c2", 4), "world": ("#cfe3f5", 6), "data": ("#d8ecd2", 5)}  # from the top down
WIDTH, HEIGHT, GAP = 620, 30, 4


def floors(checkout: Path) -> list[str]:
    """Packages from the top down."""
    contracts = tomllib.loads((checkout / "pyproject.toml").read_text())["tool"]["importlinter"]["contracts"]
    return next(contract["layers"] for contract in contracts if contract["containers"] == ["hicp_lib"])


def drawing(names: list[str]) -> str:
    """The floors as SVG, one box each."""
    fills = [fill for fill, n in COLOURS.values() for _ in range(n)]
    boxes = []
    for i, (name, fill) in enumerate(zip(names, fills, strict=True)):
        top = i * (HEIGHT + GAP)
        size = f'width="{WIDTH - 2}" height="{HEIGHT}" rx="4"'
        boxes += [
            f'<rect x="1" y="{top + 1}" {size} fill="{fill}" stroke="#777"/>',
            f'<text x="14" y="{top + 21}" font-weight="bold">{name}</text>',
            f'<text x="140" y="{top + 21}">{escape(HOLDS[name])}</text>',
        ]
    height = len(names) * (HEIGHT + GAP)
    size = f'viewBox="0 0 {WIDTH} {height}" width="{WIDTH}" height="{height}"'
    style = 'font-family="sans-serif" font-size="15" fill="#111"'
    return "\n".join([f'<svg xmlns="http://www.w3.org/2000/svg" {size} {style}>', *boxes, "</svg>\n"])


if __name__ == "__main__":
    (CHECKOUT / DRAWING).write_text(drawing(floors(CHECKOUT)))
