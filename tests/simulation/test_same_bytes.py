"""A result follows from what it is asked for: never from what its process did before, nor from any order."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from scipy import sparse

from hicp_lib.core.memo import memoised
from hicp_lib.experiments.minimum_jerk import Posture, between
from hicp_lib.simulation.appearance import clothing
from hicp_lib.simulation.appearance.clothing import Garment
from tests.simulation.contents import content
from tests.simulation.made_results import dressed

ROOT = Path(__file__).parents[2]


def python(module: str, *arguments: object, **environment: str) -> list[str]:
    """Lines that a module of this folder prints in a process of its own."""
    done = subprocess.run(
        [sys.executable, "-m", f"tests.simulation.{module}", *map(str, arguments)],
        cwd=ROOT,
        capture_output=True,
        text=True,
        env=os.environ | environment,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.splitlines()


ASKED = ["dressed 39", "dressed 100", "scene 3", "mocap 40", "lower 3", "dose 1", "avoidance 1", "dressed 71"]
ASKED += ["capture 0"]  # the last is not held against its keys
THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "OPENCV_FOR_THREADS_NUM")


@pytest.fixture(scope="module")
def watched() -> list[str]:
    """A line for each result, then what was kept on the way and what is wrong with it."""
    alone = {"PYTHONHASHSEED": "1"} | dict.fromkeys(THREADS, "1")
    return python("watch_caches", *ASKED, **alone)


def test_what_a_process_keeps_follows_from_its_key(watched):
    counted, *problems = watched[len(ASKED) :]
    assert not problems
    results, functions = (int(word) for word in counted.split() if word.isdigit())
    assert results > 300 and functions > 30


def test_results_are_the_same_in_every_process(watched):
    first = watched[: len(ASKED)]
    assert [line.rpartition(" ")[0] for line in first] == ASKED
    free = {"PYTHONHASHSEED": "2"} | dict.fromkeys(THREADS, "3")
    assert sorted(first) == sorted(python("made_results", *reversed(ASKED), **free))


def test_a_garment_is_cut_alike_of_whatever_numbers():
    numbers = (-0.05, 1.03, 0.6, 0.06)
    cuts = []
    for kind in (float, np.float64):
        clothing._cut_pattern.cache_clear()
        cuts.append(content(clothing.cut_pattern(Garment("top", *map(kind, numbers)))))
    assert cuts[0] == cuts[1]


@pytest.mark.parametrize("same", [(1, True), (1, 1.0), (0.0, 0)])
def test_equal_values_of_other_types_are_keys_of_their_own(same):
    kept = memoised()(lambda value: repr(value))
    assert [kept(value) for value in same] == [repr(value) for value in same]


@pytest.mark.parametrize(
    ("given", "key"),
    [(np.float64(0.1), 0.1), (np.float32(0.5), 0.5), (np.int64(3), 3), (-0.0, 0.0), (np.str_("a"), "a")],
)
def test_a_key_is_a_plain_number_within_tuples_too(given, key):
    kept = memoised()(lambda *values, **named: repr((values, named)))
    assert kept(given, (given, "b"), name=given) == repr(((key, (key, "b")), {"name": key}))
    assert kept(key, (key, "b"), name=key) == kept(given, (given, "b"), name=given)
    assert kept.cache_info().misses == 1


def test_what_is_kept_cannot_be_changed():
    @memoised(2)
    def cut(n: int) -> tuple[clothing.g.Mesh, dict]:
        return clothing.g.box(np.zeros(3), np.ones(3)), {
            "a": [np.arange(n), sparse.eye_array(n, format="csr")]
        }

    mesh, others = cut(3)
    for array in (mesh.vertices_m, mesh.triangles, others["a"][0], others["a"][1].data):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1
    assert cut(3)[0] is mesh and cut.cache_info().maxsize == 2


def test_people_are_dressed_alike_in_any_order():
    # Scene 39 has a polo and scene 71 a shirt of the same cut, whose numbers are drawn in different ways.
    found = []
    for order in ((39, 71, 5), (71, 5, 39)):
        clothing._cut_pattern.cache_clear()
        found.append({number: dressed(number) for number in order})
    assert found[0] == found[1]


def test_the_hash_of_texts_moves_nothing():
    a, b = Posture({"x": 0.1, "y": 0.2, "z": 0.3}, (0.0, 0.0)), Posture({"z": 0.5, "w": 1.0}, (0.0, 1.0))
    assert [*between(a, b, 0.5).joints] == ["x", "y", "z", "w"]
