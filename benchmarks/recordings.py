"""How long simulating the study's recordings takes, and what a frame of them costs.

Whole recordings, as `hicp record simulate` writes them: images and depth drawn, measured and
written, truth, joints and motion capture; `--share 1` times them whole, less the first part of them
(reading the library and the scene in every process counts in full). The floors of the project are 40
s for the 100 views and 180 s for the 480 frames with motion capture, on two free processors. The
baseline, in the same run, is drawing the frames alone: what `render` takes for the same scenes. A frame
is drawn, measured and written; what every process does once (the library, the scene, all movements of the
person) is told apart. Processor time tells more than wall time on a machine that is busy otherwise.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from timing import Comparison, run

from hicp_lib.core.executor import Processes
from hicp_lib.experiments.recordings.frames import camera_at, record_frame
from hicp_lib.experiments.recordings.scenarios import SCENARIOS, Scenario
from hicp_lib.experiments.recordings.simulate import record_one, simulate_recording
from hicp_lib.simulation.body.identities import Subject
from hicp_lib.simulation.rendering.render import render

FLOORS_S = {"relative-upper": 40.0, "relative-lower": 40.0, "mocap": 180.0}


def frame_cost(name: str, n_timed: int) -> dict[str, float]:
    """Mean processor seconds of `n_timed` frames, and of drawing them alone."""
    plan = SCENARIOS[name]
    last = plan.n_frames - 1
    record_frame(name, Subject(), last)  # the scene is made with all movements, textures too
    once_s = time.process_time()
    drawn_s, frame_s = [], []
    with tempfile.TemporaryDirectory() as folder:
        for k in np.linspace(0, last - 1, n_timed).astype(int).tolist():
            drawn_s.append(_draw(plan, k))
            start_s = time.process_time()
            record_one(Path(folder), name, Subject(), k)
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
    world, _ = plan.stage(Subject(), float(plan.times_s(k + 1)[k]))
    camera = camera_at(plan, k)
    start_s = time.process_time()
    render(world, camera)
    return time.process_time() - start_s


def whole_s(name: str, n: int, workers: int) -> float:
    """Wall seconds of simulating the first `n` frames into a folder."""
    with tempfile.TemporaryDirectory() as folder:
        start_s = time.perf_counter()
        simulate_recording(Path(folder) / name, name, n, workers=workers, progress=False)
        return time.perf_counter() - start_s


def compare(name: str, options) -> Iterator[Comparison]:
    """One scenario's figures."""
    with Processes(1) as pool:  # one thread, as when recordings are made
        cost = pool.submit(frame_cost, name, options.timed).result()
    n_all, workers, drawn_s = SCENARIOS[name].n_frames, options.workers, cost["drawn_s"]
    n = max(2, round(options.share * n_all))
    yield Comparison(f"{name}: a frame", cost["frame_s"], "drawing it alone", drawn_s)
    yield Comparison(
        f"{name}: {n} frames, processes: {workers}, wall time",
        whole_s(name, n, workers),
        "drawing them alone, by as many",
        drawn_s * n / workers,
    )
    yield Comparison(f"{name}: what every process does once", cost["once_s"], "drawing a frame", drawn_s)
    yield Comparison(
        f"{name}: all {n_all} frames, each process of {workers}",
        cost["once_s"] + (cost["frame_s"] * n_all + cost["capture_s"]) / workers,
        "drawing them alone, by as many",
        drawn_s * n_all / workers,
        most_s=FLOORS_S[name],
    )


def measure(options) -> Iterator[Comparison]:
    for name in list(FLOORS_S)[: options.scenarios]:
        yield from compare(name, options)


if __name__ == "__main__":
    run(measure, __doc__, share=(0.2, 0.0), workers=(2, 1), timed=(8, 1), scenarios=(3, 1))
