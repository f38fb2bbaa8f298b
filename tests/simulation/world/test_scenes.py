"""Rendered data sets: valid, the same whatever the workers, resumed after an interruption."""

import json
from dataclasses import asdict
from pathlib import Path

import numpy as np
import pytest

from hicp_lib.core.errors import InputError
from hicp_lib.core.folders import locked_folder
from hicp_lib.core.images import read_image
from hicp_lib.formats.annotations import read_annotations
from hicp_lib.simulation.body.identities import HELD_OUT, KINDS, SPLITS, split_members
from hicp_lib.simulation.world import scenes
from hicp_lib.simulation.world.scenes import render_dataset, render_scene
from hicp_lib.simulation.world.staging import random_stage

N, SEED = 3, 11


@pytest.fixture(scope="module")
def dataset(tmp_path_factory) -> Path:
    out = tmp_path_factory.mktemp("rendered")
    render_dataset(out, N, SEED, workers=1, progress=False)
    return out


def test_annotations_are_those_of_the_images(dataset):
    people = read_annotations(dataset / "annotations.json")
    assert len(people.images) == N and len(people) >= N
    assert list(people.ids) == list(range(1, len(people) + 1))
    for info in people.images.values():
        assert read_image(dataset / "images" / info.file_name).shape == (info.height_px, info.width_px, 3)
    for row in range(len(people)):
        info = people.images[int(people.image_ids[row])]
        x, y, width, height = people.boxes_px[row]
        assert x >= 0 and y >= 0 and x + width <= info.width_px and y + height <= info.height_px
        assert 0 < people.areas_px2[row] <= width * height
        points = people.keypoints_px[row][people.visibility[row] > 0]
        assert (points >= 0).all() and (points <= [info.width_px - 1, info.height_px - 1]).all()
        seen = people.keypoints_px[row][people.visibility[row] == 2]
        assert (seen >= [x - 12, y - 12]).all() and (seen <= [x + width + 12, y + height + 12]).all()
        assert 0.4 < people.extras[row]["distance_m"] < 8
    assert set(np.unique(people.visibility)) <= {0, 1, 2}


def test_points_outside_are_written_as_zeros(dataset):
    for person in json.loads((dataset / "annotations.json").read_text())["annotations"]:
        triples = np.array(person["keypoints"]).reshape(136, 3)
        assert (triples[triples[:, 2] == 0] == 0).all()
        assert person["category_id"] == 1 and person["iscrowd"] == 0


def test_workers_change_nothing(dataset, tmp_path):
    render_dataset(tmp_path / "two", N, SEED, workers=2, progress=False)
    for path in sorted((dataset / "images").iterdir()):
        assert (tmp_path / "two" / "images" / path.name).read_bytes() == path.read_bytes()
    assert (tmp_path / "two" / "annotations.json").read_bytes() == (dataset / "annotations.json").read_bytes()


def test_seeds_and_numbers_give_different_images():
    images = [render_scene(seed, index)[0] for seed, index in ((11, 0), (12, 0))]
    assert images[0].shape != images[1].shape or (images[0] != images[1]).mean() > 0.5


def test_an_interrupted_run_is_taken_up_where_it_stopped(dataset, tmp_path, monkeypatch):
    out = tmp_path / "out"
    rendered = []

    def counted(seed, index, split, staged):
        rendered.append(index)
        if len(rendered) == 2:
            raise KeyboardInterrupt
        return render_scene(seed, index, split)

    monkeypatch.setattr(scenes, "render_scene", counted)
    with pytest.raises(KeyboardInterrupt):
        render_dataset(out, N, SEED, workers=1, progress=False)
    assert not (out / "annotations.json").exists()
    (out / "images" / "000001.jpg").write_bytes(b"half")  # an image without its people does not count
    render_dataset(out, N, SEED, workers=1, progress=False)
    assert rendered == [0, 1, 1, 2]
    assert (out / "annotations.json").read_bytes() == (dataset / "annotations.json").read_bytes()


def test_another_seed_reuses_nothing(tmp_path, monkeypatch):
    fake = {"bbox": [0, 0, 2, 2], "area": 4, "keypoints": np.zeros((136, 3)).tolist()}
    fake |= {"distance_m": 1.0, "identity": {}}
    calls = []

    def quick(seed, index, split, staged):
        calls.append((seed, index, split))
        return np.zeros((4, 4, 3), np.uint8), [fake]

    monkeypatch.setattr(scenes, "render_scene", quick)
    out = tmp_path / "out"
    render_dataset(out, 2, 1, workers=1, progress=False)
    render_dataset(out, 2, 1, workers=1, progress=False)
    assert calls == [(1, 0, HELD_OUT), (1, 1, HELD_OUT)]
    render_dataset(out, 2, 2, workers=1, progress=False)
    assert calls[2:] == [(2, 0, HELD_OUT), (2, 1, HELD_OUT)]
    render_dataset(out, 1, 2, workers=1, progress=False)
    assert [p.name for p in (out / "images").iterdir()] == ["000000.jpg"]
    monkeypatch.setattr(scenes, "key", lambda *_, **__: "of another renderer")
    render_dataset(out, 1, 2, workers=1, progress=False)
    assert calls[4:] == [(2, 0, HELD_OUT)]


@pytest.fixture
def quick(monkeypatch) -> list[int]:
    """Scenes of four pixels and one person; the numbers of those that were rendered."""
    rendered = []
    fake = {"bbox": [0, 0, 2, 2], "area": 4, "keypoints": np.zeros((136, 3)).tolist()}

    def scene(seed, index, split, staged):
        rendered.append(index)
        return np.full((4, 4, 3), seed, np.uint8), [fake | {"distance_m": 1.0, "identity": {}}]

    monkeypatch.setattr(scenes, "render_scene", scene)
    return rendered


def render_quickly(out: Path, n: int = 2, seed: int = 1) -> None:
    render_dataset(out, n, seed, workers=1, progress=False)


def test_files_of_others_stay_where_images_go(quick, tmp_path):
    render_quickly(tmp_path)
    mine = [tmp_path / "images" / name for name in ("cat.jpg", "000007.jpg", ".partial-mine.jpg")]
    for path in mine:
        path.write_bytes(b"precious")
    render_quickly(tmp_path, seed=2)
    render_quickly(tmp_path, n=1, seed=2)
    assert all(path.read_bytes() == b"precious" for path in mine)
    assert not (tmp_path / "images" / "000001.jpg").exists()
    with pytest.raises(InputError, match="000007.jpg: was not made by this command"):
        render_quickly(tmp_path, n=8, seed=2)
    assert mine[1].read_bytes() == b"precious"


@pytest.mark.parametrize("left", [b"", b"half"])
@pytest.mark.parametrize("name", ["images/000001.jpg", ".scenes/000001.json"])
def test_what_a_power_cut_left_is_rendered_again(quick, tmp_path, name, left):
    render_quickly(tmp_path)
    before = (tmp_path / "images" / "000001.jpg").read_bytes()
    (tmp_path / name).write_bytes(left)
    render_quickly(tmp_path)
    assert quick == [0, 1, 1] and (tmp_path / "images" / "000001.jpg").read_bytes() == before


@pytest.mark.parametrize("stamp", ["[]", "{}", '{"n": "2", "once": [], "stamp": {}}', ""])
def test_a_stamp_of_something_else_is_refused(quick, tmp_path, stamp):
    render_quickly(tmp_path)
    (tmp_path / ".scenes" / "stamp.json").write_text(stamp)
    with pytest.raises(InputError, match="stamp.json: "):
        render_quickly(tmp_path)
    assert quick == [0, 1]


def test_two_do_not_render_into_one_folder(quick, tmp_path):
    with locked_folder(tmp_path), pytest.raises(InputError, match="another command writes there"):
        render_quickly(tmp_path)
    assert quick == []


@pytest.mark.parametrize("split", SPLITS)
def test_a_scene_is_drawn_from_its_split_alone(split):
    members = split_members(split)
    for number in range(8):
        stage = random_stage(np.random.default_rng(number), split)
        for identity in stage.identities:
            told = asdict(identity)
            assert told["split"] == split and told["body"] in members["bodies"]
            assert all(members[kind][0] <= told[kind] <= members[kind][1] for kind in KINDS)


def test_another_split_shows_other_people(tmp_path):
    told = [render_dataset(tmp_path / split, 1, SEED, 1, False, split).extras[0] for split in SPLITS]
    assert [about["identity"]["split"] for about in told] == [*SPLITS]
    with pytest.raises(InputError, match="no people 'all'; choose one of development, held out"):
        render_dataset(tmp_path / "all", 1, SEED, 1, False, "all")
    assert not (tmp_path / "all").exists()


@pytest.mark.parametrize(
    "arguments", [dict(n=0), dict(n=-1), dict(n=1.5), dict(seed=-1), dict(workers=0), dict(n=10**9)]
)
def test_numbers_out_of_range_are_refused(tmp_path, arguments):
    with pytest.raises(InputError, match="expected"):
        render_dataset(tmp_path / "out", **(dict(n=1, seed=0, workers=1) | arguments))
    assert not (tmp_path / "out").exists()


def test_a_folder_with_other_things_is_refused(tmp_path):
    (tmp_path / "thesis.tex").write_text("precious")
    with pytest.raises(InputError, match="holds files"):
        render_dataset(tmp_path, 1, 0, workers=1)
    file = tmp_path / "thesis.tex"
    with pytest.raises(InputError, match="is a file"):
        render_dataset(file, 1, 0, workers=1)
