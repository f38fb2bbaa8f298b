"""As `made_results`, then lifts; prints what is wrong with the results that the process kept, too."""

import sys

from tests.simulation.contents import watch_caches

kept = watch_caches()

import numpy as np  # noqa: E402

from hicp_lib.experiments.laboratory import COLOUR  # noqa: E402
from hicp_lib.experiments.recordings.frames import record_frame  # noqa: E402
from hicp_lib.lifting.paper import lift  # noqa: E402
from hicp_lib.lifting.robust import lift_robust  # noqa: E402
from hicp_lib.simulation.body.identities import Subject  # noqa: E402
from tests.simulation.made_results import made  # noqa: E402

*names, last = sys.argv[1:]
for name in names:
    print(name, made(name))
_, depth_m, _, _ = record_frame("mocap", Subject(), 40)
keypoints_px = np.random.default_rng(0).uniform((250, 100), (390, 400), (1, 136, 2))
for way in (lift, lift_robust):
    way(keypoints_px, depth_m, COLOUR)
results = list(kept)  # making them again keeps more
print(last, made(last))  # would take long to be made again
problems = [problem for one in results for problem in one.problems()]
print(f"{len(results)} results of {len({one.function for one in results})} functions", *problems, sep="\n")
