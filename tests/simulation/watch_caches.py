"""Stage, render and lift in a process of its own; prints what is wrong with the results it kept."""

from tests.simulation.contents import watch_caches

kept = watch_caches()

import numpy as np  # noqa: E402

from hicp_lib.experiments.avoidance.closed_loop import Trial, TrueKeypoints, simulate  # noqa: E402
from hicp_lib.experiments.laboratory import COLOUR  # noqa: E402
from hicp_lib.experiments.recordings.frames import record_frame  # noqa: E402
from hicp_lib.lifting.paper import lift  # noqa: E402
from hicp_lib.lifting.robust import lift_robust  # noqa: E402
from hicp_lib.simulation.world.scenes import render_scene  # noqa: E402
from hicp_lib.simulation.world.staging import random_stage  # noqa: E402

for number in (39, 71, 100):
    random_stage(np.random.default_rng(np.random.SeedSequence([0, number])))
render_scene(0, 3)
_, depth_m, _, _ = record_frame("mocap", 0, 40)
keypoints_px = np.random.default_rng(0).uniform((250, 100), (390, 400), (1, 136, 2))
for way in (lift, lift_robust):
    way(keypoints_px, depth_m, COLOUR)
record_frame("relative-lower", 0, 3)
simulate(Trial("sitting, hand", 0.1), TrueKeypoints())
made = list(kept)  # making them again keeps more
problems = [problem for one in made for problem in one.problems()]
print(f"{len(made)} results of {len({one.function for one in made})} functions", *problems, sep="\n")
