"""The squares that the network for close range is trained on, and its frozen layers."""

from pathlib import Path

import numpy as np
import onnx
import onnxruntime
import pytest
from closerange import samples
from closerange.frozen import FROZEN, GRID, LEAST, SIDE_PX, frozen_layers
from closerange.make_samples import drop_others, jobs
from closerange.rows import HELD_BACK, batches, chosen_rows

from hicp_lib.core.keypoints import HEAD, INDEX, LEFT_HAND, N_KEYPOINTS, RIGHT_HAND

ROOT = Path(__file__).parents[2]

DOT_PX = 4


def colour(k):
    return 60 + k, 196 - k, 120 + 100 * np.sign(k - samples._MIRROR[k])


@pytest.fixture
def marked(monkeypatch):
    """A person on a grid, each keypoint on a dot of its own colour; pictures keep their colours."""
    monkeypatch.setattr(samples, "_photographed", lambda _rng, square: square)
    columns, rows = np.arange(N_KEYPOINTS) % 12, np.arange(N_KEYPOINTS) // 12
    points = np.stack([60.0 + 30 * columns, 50.0 + 30 * rows], axis=1)
    image = np.zeros((480, 480, 3), np.uint8)
    for k, (x, y) in enumerate(points.astype(int)):
        image[y - DOT_PX : y + DOT_PX + 1, x - DOT_PX : x + DOT_PX + 1] = colour(k)
    return image, points, np.full(N_KEYPOINTS, 2)


def drawn(marked, n, of_hand=False):
    rng = np.random.default_rng(5)
    fillers = [lambda: np.full((300, 300, 3), 7, np.uint8)]
    found = (samples.draw_sample(rng, *marked, fillers, of_hand) for _ in range(n))
    return [sample for sample in found if sample is not None]


def shown(sample, k):
    x, y = np.round(sample.keypoints_px[k]).astype(int)
    return sample.square[y, x].astype(int)


def test_visible_keypoints_lie_on_what_they_name_and_sides_swap_in_a_mirror(marked):
    ways = []
    for sample in drawn(marked, 150):
        seen = np.flatnonzero(sample.seen == 2)
        shares = [
            np.mean([np.abs(shown(sample, k) - colour(of[k])).max() < 60 for k in seen])
            for of in (np.arange(N_KEYPOINTS), samples._MIRROR)
        ]
        assert max(shares) > 0.85  # dots at the border of a view or a patch are mixed with black
        assert min(shares) < 0.5  # else the colours would not tell left from right
        ways.append(int(np.argmax(shares)))
    assert 0.3 < np.mean(ways) < 0.7


def test_what_is_not_in_the_square_has_no_position(marked):
    for sample in drawn(marked, 100):
        assert (np.isfinite(sample.keypoints_px).all(axis=1) == (sample.seen > 0)).all()
        inside = sample.keypoints_px[sample.seen > 0]
        assert (inside >= -0.5).all() and (inside < SIDE_PX - 0.5).all()


def test_covered_keypoints_are_hidden(marked):
    many = drawn(marked, 150)
    hidden = [shown(sample, k).max() for sample in many for k in np.flatnonzero(sample.seen == 1)]
    assert len(hidden) > 50 and np.mean(np.array(hidden) <= 60) > 0.9


def test_views_without_a_head_show_none(marked, monkeypatch):
    monkeypatch.setattr(samples, "VIEWS", {"headless": 1.0})
    image, points, flags = marked
    order = np.concatenate([HEAD, np.setdiff1d(np.arange(N_KEYPOINTS), HEAD)])
    upright = np.empty_like(points)
    upright[order] = points  # the head's points come first, so they lie above all others
    for sample in drawn((image, upright, flags), 60):
        rows = sample.seen[HEAD]
        assert (rows > 0).sum() <= 12  # of the row of the grid that the border goes through


def test_hands_are_right_ones(marked):
    hands = drawn(marked, 40, of_hand=True)
    assert len(hands) > 20
    for sample in hands:
        there = sample.seen[RIGHT_HAND] > 0
        assert there.mean() > 0.7
        middle = np.nanmean(sample.keypoints_px[RIGHT_HAND], axis=0)
        assert np.abs(middle - SIDE_PX / 2).max() < 0.3 * SIDE_PX


def test_the_frozen_layers_are_movenets_own():
    lightning = ROOT / "data" / "weights" / "movenet-lightning.onnx"
    session = onnxruntime.InferenceSession(frozen_layers(lightning, list(FROZEN)).SerializeToString())
    image = np.random.default_rng(0).integers(0, 256, (1, 3, SIDE_PX, SIDE_PX)).astype(np.float32)
    model = onnx.load(lightning)
    model.graph.output.extend(onnx.ValueInfoProto(name=name) for name in FROZEN.values())
    whole = onnxruntime.InferenceSession(model.SerializeToString())
    for ours, theirs in FROZEN.items():
        (kept,), (own,) = session.run([ours], {"image": image}), whole.run([theirs], {"image": image})
        if ours == "body":
            own = np.log(np.maximum(own, LEAST)).reshape(1, GRID, GRID, -1).transpose(0, 3, 1, 2)
        np.testing.assert_allclose(kept, own, rtol=1e-3, atol=1e-4)


def test_only_what_is_not_there_yet_is_drawn(tmp_path, monkeypatch):
    from hicp_lib.simulation.world.scenes import render_dataset

    render_dataset(tmp_path / "scenes", 1, 900_001, 1, split="development")
    (tmp_path / "people").mkdir()
    first = list(jobs(tmp_path, "people", "scenes", 2))
    assert [name for name, _ in first] == ["scenes_000000_0.npz", "scenes_000000_1.npz"]
    first[0][1]()
    made = (tmp_path / "people" / first[0][0]).read_bytes()
    assert [name for name, _ in jobs(tmp_path, "people", "scenes", 2)] == ["scenes_000000_1.npz"]
    first[0][1]()
    assert (tmp_path / "people" / first[0][0]).read_bytes() == made
    squares = np.load(tmp_path / "people" / first[0][0])
    assert squares["squares"].shape[1:] == (SIDE_PX, SIDE_PX, 3) and len(squares["squares"])
    assert squares["seen"][:, [*LEFT_HAND, *RIGHT_HAND, INDEX["neck"]]].shape[1] == 43


def test_squares_of_other_pictures_are_dropped(tmp_path):
    def files():
        return sorted(path.name for path in tmp_path.glob("*.npz"))

    for made_of, kept in ((["a", 4], False), (["a", 4], True), (["b", 4], False)):
        for name in ("scenes_0_0.npz", "near_0_0.npz"):
            (tmp_path / name).touch()
        drop_others(tmp_path, "scenes", made_of)
        assert files() == ["near_0_0.npz"] + ["scenes_0_0.npz"] * kept


def test_fewer_squares_than_a_step_takes_are_refused():
    with pytest.raises(SystemExit, match="5 squares to train on are fewer than one step's 8"):
        next(batches(np.arange(5), 8, 0, 0, 3))


def test_a_stopped_training_goes_on_with_the_same_batches():
    rows = np.arange(100, 177)
    whole = list(batches(rows, 8, 3, 0, 25))
    stopped = [*batches(rows, 8, 3, 0, 11), *batches(rows, 8, 3, 11, 25)]
    assert len(whole) == 25 and all((a == b).all() for a, b in zip(whole, stopped, strict=True))
    first = np.concatenate(whole[:9])
    assert len(set(first)) == 72 and set(first) <= set(rows), "each once before any comes again"
    assert (whole[0] != next(batches(rows, 8, 4, 0, 1))).any()


def test_held_back_bodies_are_not_trained_on():
    rng = np.random.default_rng(1)
    truth = {"body": rng.choice([f"b{k:02d}" for k in range(12)], 3000)}
    truth |= {"picture": rng.choice([f"p{k}" for k in range(200)], 3000)}
    truth |= {"view": rng.choice(["whole", "hand"], 3000)}
    training, checking = chosen_rows(truth, "whole+hand", 1.0)
    assert len(set(truth["body"][checking])) == HELD_BACK
    assert not set(truth["body"][training]) & set(truth["body"][checking])
    few, same = chosen_rows(truth, "hand", 0.25)
    assert set(truth["view"][few]) == {"hand"} and len(set(truth["picture"][few])) == 50
    assert (same == checking).all(), "all are judged on the same squares"
