"""Calibrations on disk: fitted to known hit rates, applied with the raw scores kept."""

import json

import numpy as np
import pandas as pd
import pytest

from hicp_lib.cli import main as cli
from hicp_lib.core.errors import InputError
from hicp_lib.evaluation.calibration.curves import Calibration
from hicp_lib.evaluation.calibration.files import apply_calibrations, read_calibrations
from hicp_lib.formats.detection_files import read_rows
from hicp_lib.formats.detections import read_detections, write_detections

N = 40


@pytest.fixture
def files(tmp_path):
    """Annotations and results of N images: the left eye, score .6, is right in a fourth, all else in all."""
    people, found = [], []
    for i in range(1, N + 1):
        truth = np.zeros((136, 3))
        truth[:5] = [[100 + 9 * k, 50, 2] for k in range(5)]
        points = truth.copy()
        points[:5, 2] = [0.9, 0.6, 0.9, 0.9, 0.9]
        points[1, 1] += 0 if i % 4 == 0 else 200
        people.append({"id": i, "image_id": i, "category_id": 1, "iscrowd": 0, "area": 30000.0,
                       "bbox": [30, 30, 160, 300], "keypoints": truth.ravel().tolist()})  # fmt: skip
        found.append({"image_id": i, "category_id": 1, "keypoints": points.ravel().tolist(), "score": 0.5,
                      "box": [1, 2, 3, 4]})  # fmt: skip
    images = [{"id": i, "file_name": f"{i}.jpg", "width": 400, "height": 400} for i in range(1, N + 1)]
    annotations = {"images": images, "annotations": people, "categories": [{"id": 1, "name": "person"}]}
    (tmp_path / "annotations.json").write_text(json.dumps(annotations))
    (tmp_path / "found.json").write_text(json.dumps(found))
    return tmp_path


def run(*arguments) -> None:
    assert cli.run([str(argument) for argument in arguments]) == 0


def test_scores_become_hit_rates_and_raw_ones_stay_beside(files, capsys):
    run("calibration", "fit", "--annotations", files / "annotations.json", "--detections",
        files / "found.json", "--detector", "mmpose", "--out", files / "cal.csv")  # fmt: skip
    assert capsys.readouterr().out.endswith(f"cal.csv: body fitted to {5 * N} keypoints\n")
    run("calibration", "apply", "--calibrations", files / "cal.csv", "--detections", files / "found.json",
        "--out", files / "calibrated.json")  # fmt: skip
    before, after = (read_detections(files / name) for name in ("found.json", "calibrated.json"))
    for image_id, people in after.items():
        np.testing.assert_allclose(people.scores[0, :5], [1, 0.25, 1, 1, 1])
        assert np.array_equal(people.keypoints_px, before[image_id].keypoints_px, equal_nan=True)
        assert people.person_scores.tolist() == [0.5] and (people.scores[0, 5:] == 0).all()
    row = json.loads((files / "calibrated.json").read_text())[0]
    assert row["raw_keypoint_scores"][:6] == [0.9, 0.6, 0.9, 0.9, 0.9, 0] and row["box"] == [1, 2, 3, 4]
    # Of what an importer wrote, the tool's own scores stay.
    imported = [{**row, "raw_keypoint_scores": [7.0] * 136, "calibrated": False}]
    (files / "imported.json").write_text(json.dumps(imported))
    apply_calibrations(files / "imported.json", read_calibrations(files / "cal.csv"), files / "out.json")
    assert json.loads((files / "out.json").read_text())[0]["raw_keypoint_scores"] == [7.0] * 136


@pytest.mark.parametrize("suffix", [".json", ".csv", ".parquet"])
def test_calibrated_results_keep_names_and_raw_scores_in_every_format_and_are_not_calibrated_again(
    files, suffix
):
    rows = json.loads((files / "found.json").read_text())
    named = [
        row | {"file_name": f"{N + 1 - row['image_id']}.jpg", "time_s": row["image_id"] / 8} for row in rows
    ]
    (files / "named.json").write_text(json.dumps(named))
    write_detections(files / f"named{suffix}", read_detections(files / "named.json", extras=(of := {})), of)
    curve = {"body": Calibration(np.array([0.0, 1.0]), np.array([0.0, 0.5]))}
    out = files / f"out{suffix}"
    assert apply_calibrations(files / f"named{suffix}", curve, out) == N
    for row, before in zip(read_rows(out), named, strict=True):
        assert (row["file_name"], row["time_s"]) == (before["file_name"], before["time_s"])
        raw, scores = np.array(row["raw_keypoint_scores"]), row["keypoints"][2::3]
        assert raw[:6].tolist() == [0.9, 0.6, 0.9, 0.9, 0.9, 0] and np.allclose(scores, raw / 2)
    with pytest.raises(InputError, match=f"out{suffix}: .* image 1 are calibrated already"):
        apply_calibrations(out, curve, files / "twice.json")


def test_the_reports_table_is_read_by_detector(files):
    table = pd.DataFrame(
        [("a", "body", 0.2, 0.1), ("a", "body", 0.8, 0.9), ("b", "hand", 0.5, 0.5)],
        columns=["detector", "group", "score", "rate"],
    )
    table.to_parquet(files / "calibrations.parquet")
    assert read_calibrations(files / "calibrations.parquet", "a")["body"](0.5) == pytest.approx(0.5)
    assert list(read_calibrations(files / "calibrations.parquet", "b")) == ["hand"]
    for name in ("", "c"):
        with pytest.raises(InputError, match="is not in it; expected one of: a, b"):
            read_calibrations(files / "calibrations.parquet", name)


@pytest.mark.parametrize(
    ("content", "expected"),
    [
        ("", "cannot be read as a table"),
        ("a,b\n1,2\n", "has no column 'detector'; expected a table with"),
        ("detector,group,score,rate\nx,feet,0.1,0.2\n", "group 'feet' is not known"),
        ("detector,group,score,rate\nx,body,0.1,0.2\nx,body,0.2,0.1\n", "rates that do not fall"),
        ("detector,group,score,rate\nx,body,0.1,1.2\n", "rates that do not fall"),
        ("detector,group,score,rate\nx,body,much,0.2\n", "rates that do not fall"),
        ("detector,group,score,rate\nx,body,0.1,0.2\n,body,0.1,0.2\n", "row 2 has no detector; expected its"),
        ("detector,group,score,rate\n", "no detector is named; expected one of: none"),
    ],
)
def test_what_is_no_calibration_is_refused_in_one_line(tmp_path, content, expected):
    (tmp_path / "cal.csv").write_text(content)
    with pytest.raises(InputError, match=expected) as refused:
        read_calibrations(tmp_path / "cal.csv")
    assert "\n" not in str(refused.value)
    with pytest.raises(InputError, match="absent.csv: cannot be read"):
        read_calibrations(tmp_path / "absent.csv")


def changed_truth(files, n_labelled: int, is_crowd: int) -> None:
    annotations = json.loads((files / "annotations.json").read_text())
    for person in annotations["annotations"]:
        person["keypoints"][3 * n_labelled :] = [0] * (408 - 3 * n_labelled)
        person["iscrowd"] = is_crowd
    (files / "annotations.json").write_text(json.dumps(annotations))


def fit(files, *more) -> int:
    return cli.run(["calibration", "fit", "--annotations", str(files / "annotations.json"), "--detections",
                    str(files / "found.json"), *map(str, more or ("--out", files / "cal.csv"))])  # fmt: skip


@pytest.mark.parametrize(("n_labelled", "is_crowd"), [(0, 0), (5, 1)])
def test_what_nobody_labelled_is_not_fitted(files, capsys, n_labelled, is_crowd):
    found = json.loads((files / "found.json").read_text())
    stray = json.loads(json.dumps(found[0])) | {"score": 0.1}
    stray["keypoints"][300:330] = [4000.0, 395.0, 0.9] * 10
    (files / "found.json").write_text(json.dumps([*found, stray]))
    assert fit(files) == 0
    assert "cal.csv: body fitted to 205 keypoints, hand not fitted: the anno" in capsys.readouterr().out
    assert list(read_calibrations(files / "cal.csv")) == ["body"]
    changed_truth(files, n_labelled, is_crowd)
    assert fit(files, "--out", files / "none.csv") == 2
    assert "no scored keypoints of labelled people" in capsys.readouterr().err
    assert not (files / "none.csv").exists()


def test_a_fit_tells_what_is_doubtful_and_refuses_names_that_are_none(files, capsys):
    annotations = json.loads((files / "annotations.json").read_text())
    for person in annotations["annotations"]:
        person["area"] = 1
    (files / "annotations.json").write_text(json.dumps(annotations))
    assert fit(files) == 0
    assert "below a hundredth of their box" in capsys.readouterr().err
    assert fit(files, "--out", files / "cal.parquet") == 2
    assert "cal.parquet: ends in '.parquet'; expected .csv" in capsys.readouterr().err
    assert fit(files, "--detector", "", "--out", files / "cal.csv") == 2
    assert "the detector's name is empty; give one" in capsys.readouterr().err


@pytest.mark.parametrize("name", ["NA", "None", "nan", "007", "null"])
def test_any_name_of_a_detector_finds_its_curves(files, name):
    assert fit(files, "--detector", name, "--out", files / "cal.csv") == 0
    assert list(read_calibrations(files / "cal.csv", name)) == ["body"]


def test_text_in_another_detectors_rows_does_no_harm(tmp_path):
    rows = "d,body,0,0.1\nd,body,1,0.5\ne,body,x,0.1\n"
    (tmp_path / "cal.csv").write_text(f"detector,group,score,rate\n{rows}")
    assert read_calibrations(tmp_path / "cal.csv", "d")["body"](0.5) == pytest.approx(0.3)
