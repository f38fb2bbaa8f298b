"""How long simulating the study's recordings takes, and what a frame of them costs.

    python benchmarks/recordings.py [--share 0.2] [--workers 2] [--json OUT]

Whole recordings, as `hicp record simulate` writes them: images and depth drawn, measured and
written, truth, joints and motion capture; `--share 1` times them whole, less the first part of them
(reading the library and the scene in every process counts in full). The floors of the project are 40
s for the 100 views and 180 s for the 480 frames with motion capture, on two free processors. The
baseline, in the same run, is drawing the frames alone: what `render` takes for the same scenes. A frame
is drawn, measured and written; what every process does once (the library, the scene, all movements of the
person) is told apart. Processor time tells more than wall time on a machine that is busy otherwise.
"""

from __future__ import annotations

import argparse
import json
import tempfile
import time
from pathlib import Path

import numpy as np

from hicp_lib.experiments.recordings.frames import camera_at, record_frame, stage
from hicp_lib.experiments.recordings.scenarios import SCENARIOS, Scenario
from hicp_lib.experiments.recordings.simulate import record_one, simulate_recording
from hicp_lib.simulation.rendering.render import render
from hicp_lib.simulation.world.scenes import worker_pool

FLOORS_S = {"relative-upper": 40.0, "relative-lower": 40.0, "mocap": 180.0}
N_TIMED = 8  # frames whose processor time is measured


def frame_cost(name: str) -> dict[str, float]:
    """Mean processor seconds of a frame, and of drawing it alone."""
    plan = SCENARIOS[name]
    last = plan.n_frames - 1
    record_frame(name, 0, last)  # the scene is made with all movements, textures too
    once_s = time.process_time()
    drawn_s, frame_s = [], []
    with tempfile.TemporaryDirectory() as folder:
        for k in np.linspace(0, last - 1, N_TIMED).astype(int).tolist():
            drawn_s.append(_draw(plan, k))
            start_s = time.process_time()
            record_one(Path(folder), name, 0, k)
            frame_s.append(time.process_time() - start_s)
    return {
        "frame_s": float(np.mean(frame_s)),
        "drawn_s": float(np.mean(drawn_s)),
        "once_s": once_s,
        "capture_s": _capture(plan),
    }


def _capture(plan: Scenario) -> float:
    """Processor seconds of the motion capture of a whole recording; a part of it is timed."""
    if plan.capture is None:
        return 0.0
    whole_s, part_s = plan.n_frames / plan.rate_hz, 4.0
    start_s = time.process_time()
    plan.capture(0, part_s, np.eye(4))
    return (time.process_time() - start_s) * whole_s / part_s


def _draw(plan: Scenario, k: int) -> float:
    world, _ = stage(plan.name, 0)(float(plan.times_s(k + 1)[k]))
    camera = camera_at(plan, k)
    start_s = time.process_time()
    render(world, camera, np.random.default_rng(k))
    return time.process_time() - start_s


def whole_s(name: str, n: int, workers: int) -> float:
    """Wall seconds of simulating the first `n` frames into a folder."""
    with tempfile.TemporaryDirectory() as folder:
        start_s = time.perf_counter()
        simulate_recording(Path(folder) / name, name, n, workers=workers, progress=False)
        return time.perf_counter() - start_s


def measure(name: str, share: float, workers: int, cost: dict[str, float]) -> dict[str, float]:
    """One scenario's figures."""
    n = max(2, round(share * SCENARIOS[name].n_frames))
    wall_s = whole_s(name, n, workers)
    return {
        "frames": n,
        "wall_s": wall_s,
        "frames_per_second": n / wall_s,
        "floor_s": FLOORS_S[name],
        "cpu_s_per_frame": cost["frame_s"],
        "cpu_s_once_per_worker": cost["once_s"],
        "cpu_s_capture": cost["capture_s"],
        "cpu_s_whole_per_worker": cost["once_s"]
        + (cost["frame_s"] * SCENARIOS[name].n_frames + cost["capture_s"]) / workers,
        "ratio_to_drawing_alone": cost["frame_s"] / cost["drawn_s"],
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--share", type=float, default=0.2)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--json")
    options = parser.parse_args()
    result = {}
    for name in FLOORS_S:
        with worker_pool(1) as pool:  # one thread, as when recordings are made
            cost = pool.apply(frame_cost, (name,))
        result[name] = measure(name, options.share, options.workers, cost)
    for name, row in result.items():
        print(f"{name}: {row['frames']} frames in {row['wall_s']:.1f} s ({row['frames_per_second']:.2f}/s)")
        print(
            f"  {row['cpu_s_per_frame'] * 1e3:.0f} ms of processor time per frame, "
            f"{row['ratio_to_drawing_alone']:.2f} times the baseline: drawing alone"
        )
        print(
            f"  once: {row['cpu_s_once_per_worker']:.1f} s in every process, "
            f"{row['cpu_s_capture']:.1f} s for motion capture"
        )
        print(
            f"  the whole recording takes {row['cpu_s_whole_per_worker']:.0f} s of each of {options.workers} "
            f"processors; floor {row['floor_s']:.0f} s"
        )
    if options.json:
        Path(options.json).write_text(json.dumps(result, indent=2) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
