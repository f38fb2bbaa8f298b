"""Close: crops of single parts, chosen by their annotations."""

import numpy as np
import pytest

from hicp_lib.core.images import read_image, write_png
from hicp_lib.core.keypoints import HEAD, INDEX, LEFT_HAND, N_KEYPOINTS, RIGHT_HAND
from hicp_lib.datasets.close import AIMS, open_close
from hicp_lib.datasets.visibility import visibility_class
from hicp_lib.formats.annotations import Annotations, ImageInfo, read_annotations, write_annotations

ORIGIN = (30, 40)  # of the crops of Basic in their source images


def skeleton() -> np.ndarray:
    """Somebody who spreads their arms, 400 pixels high."""
    points = np.full((N_KEYPOINTS, 2), (200.0, 200.0))
    points[HEAD] = [200, 50] + np.random.default_rng(0).uniform(-40, 40, (len(HEAD), 2))
    for side, sign, hand in (("left", 1, LEFT_HAND), ("right", -1, RIGHT_HAND)):
        for name, (dx, y) in {"shoulder": (50, 130), "elbow": (90, 180), "wrist": (160, 230), 
                              "hip": (30, 250),
                              "knee": (60, 330), "ankle": (60, 390)}.items():  # fmt: skip
            points[INDEX[f"{side}_{name}"]] = 200 + sign * dx, y
        points[hand] = [200 + sign * 170, 240] + np.random.default_rng(1).uniform(-15, 15, (21, 2))
    return points


@pytest.fixture
def basic(tmp_path, monkeypatch):
    monkeypatch.setenv("HICP_CACHE", str(tmp_path / "cache"))
    n = 4
    images = {i: ImageInfo(i, f"{i}.png", 400, 420) for i in range(1, n + 1)}
    rng = np.random.default_rng(2)
    for image in images.values():
        write_png(tmp_path / "images" / image.file_name, rng.integers(0, 255, (420, 400, 3), dtype=np.uint8))
    flags = np.full((n, N_KEYPOINTS), 2.0)
    extras = [{"source_id": i, "source_image_id": 1, "crop_px": [*ORIGIN, 430, 460]} for i in images]
    people = Annotations(
        images, np.array(list(images)), np.array(list(images)), np.tile([0.0, 0, 400, 420], (n, 1)),
        np.full(n, 60_000.0), np.zeros(n, bool), np.stack([skeleton()] * n), flags, extras,
    )  # fmt: skip
    write_annotations(tmp_path / "annotations.json", people)
    return tmp_path


def test_every_crop_is_of_a_class_aimed_at_and_no_class_has_more_than_asked_for(basic):
    people = read_annotations(open_close(basic, n_per_class=3, min_pixels=500) / "annotations.json")
    names, counts = np.unique(visibility_class(people.visibility), return_counts=True)
    assert set(names) <= set(AIMS) and {"only head", "only left arm", "only legs"} <= set(names)
    assert (counts == 3).all()


def test_crops_are_the_pixels_of_basic_where_they_say_they_are(basic):
    folder = open_close(basic, n_per_class=1, min_pixels=500)
    people = read_annotations(folder / "annotations.json")
    for row, image in enumerate(people.images.values()):
        about = people.extras[row]
        left, top, right, bottom = np.array(about["crop_px"]) - [*ORIGIN, *ORIGIN]
        source = read_image(basic / "images" / f"{about['source_id']}.png")
        pixels = read_image(folder / "images" / image.file_name)
        np.testing.assert_array_equal(pixels, source[top:bottom, left:right])
        seen = people.visibility[row] > 0
        np.testing.assert_allclose(people.keypoints_px[row, seen] + [left, top], skeleton()[seen])


def test_small_crops_are_left_out(basic):
    people = read_annotations(open_close(basic, n_per_class=9, min_pixels=9_500) / "annotations.json")
    assert min(image.width_px * image.height_px for image in people.images.values()) >= 9_500
    assert "only head" not in visibility_class(people.visibility)


def test_no_crop_at_all_is_an_empty_data_set(basic):
    people = read_annotations(open_close(basic, min_pixels=500_000) / "annotations.json")
    assert len(people) == len(people.images) == 0


def test_a_crop_is_the_parts_extent_grown_by_a_tenth_of_its_larger_side(basic):
    folder = open_close(basic, n_per_class=1, min_pixels=500)
    people = read_annotations(folder / "annotations.json")
    row = visibility_class(people.visibility).tolist().index("only legs")
    # Knees and ankles: 140 to 260 wide, 330 to 390 high; 12 pixels more on every side.
    left, top, right, bottom = np.array(people.extras[row]["crop_px"]) - [*ORIGIN, *ORIGIN]
    assert (left, top, right, bottom) == (128, 318, 272, 402)


def test_a_crop_of_just_the_least_size_is_taken(basic):
    n_pixels = (272 - 128) * (402 - 318)
    for least, n in ((n_pixels, 4), (n_pixels + 1, 0)):
        people = read_annotations(open_close(basic, min_pixels=least) / "annotations.json")
        assert (visibility_class(people.visibility) == "only legs").sum() == n
