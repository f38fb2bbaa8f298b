"""Random streams of keypoints against the avoidance loop: nothing may break, no bound may be crossed.

    python benchmarks/random_streams.py [--streams 10000] [--cycles 40] [--seed 0] [--json OUT]

Every stream drives a robot from a random posture through a number of cycles of 20 ms, with any of: lost
frames, NaN, jumps, keypoints inside the robot, impossible scores and times, numbers beyond any room, people
who come and go, up to 50 at once. Counts exceptions, and commands that are not finite, too fast, against
a joint's limits or a cable. The tests run a few of the same streams.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections import Counter
from pathlib import Path

import numpy as np
from tqdm import tqdm

from hicp_lib.robot.home import home_posture
from hicp_lib.robot.kinematics import load_icub

sys.path.insert(0, str(Path(__file__).parents[1]))
from tests.robot.keypoint_streams import first_violation  # noqa: E402


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--streams", type=int, default=10_000)
    parser.add_argument("--cycles", type=int, default=40)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--json", type=Path)
    arguments = parser.parse_args()
    icub = load_icub()
    home, problems, start = home_posture(icub), {}, time.perf_counter()
    for stream in tqdm(range(arguments.streams)):
        rng = np.random.default_rng((arguments.seed, stream))
        try:
            problem = first_violation(rng, icub, home, arguments.cycles)
        except Exception as error:  # whatever it is, it is what is looked for
            problem = repr(error)
        if problem:
            problems[stream] = problem
    result = {
        "streams": arguments.streams,
        "cycles": arguments.streams * arguments.cycles,
        "seconds": time.perf_counter() - start,
        "problems": problems,
    }
    print(f"{result['streams']} streams, {result['cycles']} cycles: {len(problems)} streams with problems")
    for problem, number in Counter(text.split(" s: ")[-1] for text in problems.values()).most_common():
        print(f"  {number} x {problem}")
    if arguments.json:
        arguments.json.write_text(json.dumps(result, indent=1))
    sys.exit(bool(problems))


if __name__ == "__main__":
    main()
