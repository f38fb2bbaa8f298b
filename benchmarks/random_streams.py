"""Random streams of keypoints against the avoidance loop: nothing may break, no bound may be crossed.

Every stream drives a robot from a random posture through a number of cycles of 20 ms, with any of: lost
frames, NaN, jumps, keypoints inside the robot, impossible scores and times, numbers beyond any room, people
who come and go, up to 50 at once. Counts exceptions, and commands that are not finite, too fast, against
a joint's limits or a cable, and ends with 1 if there were any. What a cycle costs is compared with making its
keypoints alone. The tests run a few of the same streams.
"""

from __future__ import annotations

import sys
import time
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from timing import Comparison, run
from tqdm import tqdm

from hicp_lib.robot.home import home_posture
from hicp_lib.robot.kinematics import load_icub

sys.path.insert(0, str(Path(__file__).parents[1]))
from tests.robot.keypoint_streams import CYCLE_S, first_violation, random_stream  # noqa: E402


def measure(options) -> Iterator[Comparison]:
    icub = load_icub()
    home, problems, start_s = home_posture(icub), {}, time.process_time()
    for stream in tqdm(range(options.streams), disable=None):
        rng = np.random.default_rng((options.seed, stream))
        try:
            problem = first_violation(rng, icub, home, options.cycles)
        except Exception as error:  # whatever it is, it is what is looked for
            problem = repr(error)
        if problem:
            problems[stream] = problem
    whole_s, start_s = time.process_time() - start_s, time.process_time()
    for stream in range(options.streams):
        list(random_stream(np.random.default_rng((options.seed, stream)), options.cycles))
    alone_s, n = time.process_time() - start_s, options.streams * options.cycles
    yield Comparison("a cycle", whole_s / n, "making its keypoints alone", alone_s / n, most_s=CYCLE_S)
    print(f"{options.streams} streams, {n} cycles: {len(problems)} streams with problems")
    for problem, number in Counter(text.split(" s: ")[-1] for text in problems.values()).most_common():
        print(f"  {number} x {problem}")
    if problems:
        sys.exit(1)


if __name__ == "__main__":
    run(measure, __doc__, streams=(10_000, 5), cycles=(40, 10), seed=(0, 0))
