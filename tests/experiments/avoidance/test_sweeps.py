"""Sweeps: who is met under what, and that what is swept has its effect."""

import pandas as pd

from hicp_lib.experiments.avoidance.closed_loop import Latency, Trial
from hicp_lib.experiments.avoidance.reaching import NEAR_S
from hicp_lib.experiments.avoidance.sweeps import Variant, least_distances, sweep, variants
from hicp_lib.simulation.body.identities import Subject

PERSON = Trial("standing, hand", NEAR_S + 0.4, Subject(), camera_hz=10.0)


def test_one_thing_is_swept_at_a_time_and_nothing_twice():
    found = variants([PERSON], {}, {}, speeds_m_s=(0.0, 0.8), latencies_s=(0.0, 0.3), losses=(0.0, 0.9))
    at = [(v.trial.follow_m_s, v.latency.total_s, v.lost_share) for v in found]
    assert sorted(at) == [(0.0, 0.0, 0.0), (0.0, 0.0, 0.9), (0.0, 0.3, 0.0), (0.8, 0.0, 0.0)]


def test_latency_losses_and_following_bring_the_person_nearer():
    plain = Variant(Trial(**vars(PERSON) | {"follow_m_s": 0.0}), "ground truth")
    others = [
        Variant(plain.trial, "ground truth", latency=Latency(transport_s=0.3)),
        Variant(plain.trial, "ground truth", lost_share=0.9, burst_images=5.0),
        Variant(PERSON, "ground truth"),
    ]
    table = sweep([plain, *others], {})
    assert table["subject"].eq(0).all() and table["latency_s"].tolist() == [0, 0.3, 0, 0]
    least_m = table["min_distance_m"]
    assert (least_m[1:] < least_m[0] - 0.003).all()


def test_the_first_reach_ends_before_the_person_leaves():
    cycles = pd.DataFrame({"t_s": [1.0, NEAR_S, NEAR_S + 0.1], "distance_m": [0.3, 0.1, 0.02]})
    assert least_distances(cycles) == {"reach_m": 0.1, "min_distance_m": 0.02}
