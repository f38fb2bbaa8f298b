"""Files of detections: what is read is what was written, in each format, to the last bit."""

import json

import numpy as np
import pandas as pd
import pytest

from hicp_lib.core.detections import Detections
from hicp_lib.core.errors import InputError
from hicp_lib.formats import detection_files
from hicp_lib.formats.detection_files import SUFFIXES, open_detections, read_rows
from hicp_lib.formats.detections import write_detections


def made(n: int, seed: int) -> Detections:
    rng = np.random.default_rng(seed)
    points = rng.normal(200, 300, (n, 136, 2))
    points[:, 26:] = np.nan
    points[:, 3, 1] = np.nan
    scores = np.where(np.isfinite(points).all(axis=-1), rng.random((n, 136)), 0.0)
    return Detections(points, scores, rng.random(n))


IMAGES = {7: made(2, 0), 9: made(0, 1), 3: made(1, 2), 12: made(3, 3)}


def write(path, images=IMAGES):
    with open_detections(path) as append:
        for image_id, found in images.items():
            append(image_id, {"file_name": f"{image_id}.png"}, found)


@pytest.mark.parametrize(("at_once", "n_rows"), [(1, 10), (2, 25), (3, 26), (4, 110), (1000, 2**20)])
@pytest.mark.parametrize("suffix", SUFFIXES)
def test_what_is_read_is_what_was_written(tmp_path, suffix, at_once, n_rows, monkeypatch):
    monkeypatch.setattr(detection_files, "_PEOPLE_AT_ONCE", at_once)
    monkeypatch.setattr(detection_files, "_ROWS_AT_ONCE", n_rows)
    path = tmp_path / f"d{suffix}"
    write(path)
    rows = read_rows(path)
    assert [row["image_id"] for row in rows] == [7, 7, 3, 12, 12, 12]
    assert all(row["file_name"] == f"{row['image_id']}.png" for row in rows)
    for image_id, found in IMAGES.items():
        its = [row for row in rows if row["image_id"] == image_id]
        assert [row["score"] for row in its] == found.person_scores.tolist()
        for i, row in enumerate(its):
            triples = np.reshape(row["keypoints"], (136, 3))
            given = np.isfinite(found.keypoints_px[i]).all(axis=-1)
            assert given.sum() == 25 and not triples[~given].any()
            assert np.array_equal(triples[given, :2], found.keypoints_px[i, given])
            assert np.array_equal(triples[given, 2], found.scores[i, given])


@pytest.mark.parametrize("images", [{}, {1: made(0, 0)}, {i: made(int(i == 3), 0) for i in range(4)}])
@pytest.mark.parametrize("suffix", SUFFIXES)
def test_nobody_is_an_answer(tmp_path, suffix, images, monkeypatch):
    monkeypatch.setattr(detection_files, "_PEOPLE_AT_ONCE", 2)
    write(tmp_path / f"d{suffix}", images)
    assert [row["image_id"] for row in read_rows(tmp_path / f"d{suffix}")] == [3] * any(
        map(len, images.values())
    )


def test_a_table_is_tidy_and_its_columns_say_their_units(tmp_path):
    write(tmp_path / "d.parquet")
    table = pd.read_parquet(tmp_path / "d.parquet")
    assert list(table) == [
        "image_id", "file_name", "person", "person_score", "keypoint", "u_px", "v_px", "score",
    ]  # fmt: skip
    assert len(table) == 6 * 25
    assert (table.loc[table["image_id"] == 12, "person"].unique() == [0, 1, 2]).all()


@pytest.mark.parametrize("suffix", SUFFIXES[1:])
def test_what_is_known_of_some_people_only_is_told_when_it_becomes_a_table(tmp_path, suffix, monkeypatch):
    monkeypatch.setattr(detection_files, "_PEOPLE_AT_ONCE", 1)
    raw = "raw_keypoint_scores"
    for first, other in (({"time_s": 0.5}, {}), ({raw: [0.5] * 136}, {raw: [0.5]})):
        with pytest.raises(InputError, match=f"d{suffix}: people's file_name, .* no columns of a table"):
            write_detections(tmp_path / f"d{suffix}", IMAGES, {7: [first] * 2, 3: [other], 12: [first] * 3})


def test_nothing_is_left_of_a_file_that_was_cut_off(tmp_path):
    for suffix in SUFFIXES:
        with pytest.raises(KeyError), open_detections(tmp_path / f"d{suffix}") as append:
            append(7, {}, IMAGES[7])
            raise KeyError
    assert list(tmp_path.iterdir()) == []


def test_other_suffixes_are_refused_before_anything_is_written(tmp_path):
    for name, told in (("d.xml", "'.xml'"), ("d", "'no suffix'"), ("d.JSON", "'.JSON'")):
        with pytest.raises(InputError, match=rf"{name}: ends in {told}; expected .json, .csv, .parquet"):
            write(tmp_path / name)
    assert list(tmp_path.iterdir()) == []


def test_a_score_that_is_no_number_is_not_written_as_one(tmp_path):
    bad = Detections(IMAGES[3].keypoints_px, IMAGES[3].scores, np.array([np.nan]))
    with pytest.raises(ValueError, match="image 3: a score is not a finite number"):
        write(tmp_path / "d.json", {3: bad})


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (lambda table: table.drop(columns="u_px"), "has no column 'u_px'; expected a table with image_id"),
        (lambda table: table.assign(keypoint="wing"), "is not a table written by hicp detect .*wing"),
    ],
)
@pytest.mark.parametrize("suffix", [".csv", ".parquet"])
def test_a_table_of_another_kind_is_refused(tmp_path, suffix, change, told):
    path = tmp_path / f"d{suffix}"
    write(tmp_path / "d.parquet")
    table = change(pd.read_parquet(tmp_path / "d.parquet"))
    table.to_csv(path, index=False) if suffix == ".csv" else table.to_parquet(path)
    with pytest.raises(InputError, match=told):
        read_rows(path)


@pytest.mark.parametrize("suffix", [".csv", ".parquet"])
def test_a_person_whose_rows_are_far_apart_is_told(tmp_path, suffix, monkeypatch):
    write(tmp_path / "d.parquet")
    table = pd.read_parquet(tmp_path / "d.parquet").sort_values("keypoint", kind="stable")
    path = tmp_path / f"d{suffix}"
    table.to_csv(path, index=False) if suffix == ".csv" else table.to_parquet(path, index=False)
    assert len(read_rows(path)) == 6  # in one part, their order does not matter
    monkeypatch.setattr(detection_files, "_ROWS_AT_ONCE", 30)
    with pytest.raises(InputError, match="person 0 of image .* are far apart; sort them by image_id"):
        read_rows(path)


@pytest.mark.parametrize("suffix", [".csv", ".parquet"])
def test_what_is_no_table_is_told_in_one_line(tmp_path, suffix):
    (tmp_path / f"d{suffix}").write_bytes(b"\x00\xff\n,,,\n")
    with pytest.raises(InputError) as error:
        read_rows(tmp_path / f"d{suffix}")
    assert "\n" not in str(error.value)


def test_the_list_is_strict_json(tmp_path):
    write(tmp_path / "d.json")
    assert len(json.loads((tmp_path / "d.json").read_text())) == 6
