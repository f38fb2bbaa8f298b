"""Where people come from: made once, made anew when something changed, refused in one line."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from hicp_lib.core.errors import InputError
from hicp_lib.datasets import subsets
from hicp_lib.formats.annotations import Annotations, ImageInfo, read_annotations, write_annotations
from hicp_lib.study import sources
from hicp_lib.study.sources import open_near, open_source


@pytest.fixture
def halpe(tmp_path, monkeypatch):
    """One annotated person in one image, and an empty cache."""
    monkeypatch.setenv("HICP_CACHE", str(tmp_path / "cache"))
    images = tmp_path / "images"
    images.mkdir()
    cv2.imwrite(str(images / "1.png"), np.full((300, 300, 3), 80, np.uint8))
    points = np.random.default_rng(0).uniform(20, 280, (1, 136, 2))
    points[:, :, 1] = 150 + points[:, :, 1] / 3
    points[:, [0, 1, 2, 3, 4, 17], 1] = 40
    visibility = np.full((1, 136), 2.0)
    visibility[:, 26:94] = 0
    points[visibility == 0] = np.nan
    people = Annotations(
        {1: ImageInfo(1, "1.png", 300, 300)}, np.array([7]), np.array([1]), np.array([[0, 0, 300, 300.0]]),
        np.array([30_000.0]), np.array([False]), points, visibility, [{}],
    )  # fmt: skip
    write_annotations(tmp_path / "people.json", people)
    return tmp_path / "people.json", images


def test_crops_are_made_once(halpe, monkeypatch):
    data = open_source("halpe", *halpe)
    assert data.summary["basic"]["kept"] == data.summary["headless"]["kept"] == 1
    assert (data.headless / "annotations.json").is_file()
    assert data.kind == "halpe" and "people.json" in data.note
    monkeypatch.setattr(subsets, "read_annotations", None)  # a second call must not need it
    assert open_source("halpe", *halpe) == data


def test_a_changed_image_limit_or_rule_makes_new_crops(halpe, monkeypatch, tmp_path):
    folders = {open_source("halpe", *halpe).basic}
    folders.add(open_source("halpe", *halpe, min_pixels=30_000).basic)
    cv2.imwrite(str(halpe[1] / "1.png"), np.full((300, 300, 3), 81, np.uint8))
    folders.add(open_source("halpe", *halpe).basic)
    monkeypatch.setattr(sources, "key", lambda *_, **__: "of other rules")
    folders.add(open_source("halpe", *halpe).basic)
    assert len(folders) == 4


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("photographs",), "source='photographs' is unknown; use one of rendered, halpe"),
        (("halpe",), "source=halpe needs annotations_path=HALPE.json and images_dir=DIR"),
        (("halpe", "nowhere.json", "."), "nowhere.json: is not there; give the path of the annotation file"),
        (("halpe", __file__, "nowhere"), "nowhere: is not there; give the folder"),
    ],
)
def test_what_is_missing_is_said(arguments, message):
    with pytest.raises(InputError, match=message):
        open_source(*arguments)


def test_only_rendered_people_are_seen_from_near(halpe):
    data = open_source("halpe", *halpe)
    assert open_near(data, 1, 0, 20_000) is None
    near = open_near(replace(data, kind="rendered"), 1, 0, 20_000)
    (seen,), crops = (
        read_annotations(near.annotations).extras,
        read_annotations(near.basic / "annotations.json"),
    )
    assert seen["distance_m"] < 2 and seen["identity"]["split"] == "held out"
    assert near.kind == "near" and "from near" in near.note and len(crops) == 1
    with pytest.raises(InputError, match="is min_pixels too large"):
        open_near(replace(data, kind="rendered"), 1, 0, 10**6)
