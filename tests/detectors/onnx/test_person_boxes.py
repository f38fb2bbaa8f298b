"""Person boxes from exports with and without suppression, back in the image."""

import numpy as np
import pytest
from onnx import helper

from hicp_lib.core.errors import InputError
from hicp_lib.detectors.onnx.person_boxes import PersonBoxes
from tests.detectors.onnx.onnx_models import constant_model, save

IMAGE = np.zeros((120, 200, 3), np.uint8)  # into 64 x 64: scale 0.32, 64 x 38 pixels (38.4 cut off)
SCALE = np.array([64 / 200, 38 / 120])


def with_suppression(path, rows, labels=None):
    outputs = {"dets": np.array([rows], np.float32)}
    if labels is not None:
        outputs["labels"] = np.array([labels], np.int64)
    return constant_model(path, (1, 3, 64, 64), outputs)


def raw_rows(boxes, scores, classes=2):
    """YOLOX rows for a 64 x 64 input (64 + 16 + 4 cells) that hold the given boxes (x, y, w, h), one each."""
    rows = np.zeros((84, 5 + classes))
    rows[:, 2:4] = 0
    cells = [(s, x, y) for s in (8, 16, 32) for y in range(64 // s) for x in range(64 // s)]
    for (x, y, w, h), score, row in zip(boxes, scores, (0, 27, 70, 83), strict=False):
        stride, cx, cy = cells[row]
        rows[row, :2] = (x + w / 2) / stride - cx, (y + h / 2) / stride - cy
        rows[row, 2:4] = np.log(w / stride), np.log(h / stride)
        rows[row, 4:6] = score, 1
    return rows


def test_boxes_of_people_come_back_to_the_image(tmp_path):
    rows = [[6.4, 3.8, 32, 19, 0.9], [0, 0, 64, 38, 0.5], [1, 1, 9, 9, 0.2], [5, 5, 20, 20, 0.8]]
    path = with_suppression(tmp_path / "p.onnx", rows, labels=[0, 0, 0, 7])
    boxes, scores = PersonBoxes(path).find(IMAGE)
    np.testing.assert_allclose(scores, [0.9, 0.5])
    np.testing.assert_allclose(boxes, [[20, 12, 80, 48], [0, 0, 200, 120]], atol=1e-4)


def test_an_export_without_labels_is_all_people(tmp_path):
    boxes, _ = PersonBoxes(with_suppression(tmp_path / "p.onnx", [[0, 0, 32, 38, 0.9]])).find(IMAGE)
    np.testing.assert_allclose(boxes, [[0, 0, 100, 120]], atol=1e-4)


def test_raw_rows_are_decoded_and_suppressed(tmp_path):
    truth = np.array([[4, 4, 20, 30], [30, 2, 25, 34], [5, 4, 20, 30]])
    rows = raw_rows(truth, [0.9, 0.8, 0.7])
    path = constant_model(tmp_path / "p.onnx", (1, 3, 64, 64), {"output": rows[None].astype(np.float32)})
    boxes, scores = PersonBoxes(path).find(IMAGE)
    np.testing.assert_allclose(scores, [0.9, 0.8], rtol=1e-6)
    np.testing.assert_allclose(boxes, truth[:2] / np.tile(SCALE, 2), rtol=1e-4)


def decoded_rows(rows, size_px=64):
    """The same as YOLOX gives it with the decoding inside: centre and size in pixels."""
    cells = np.array(
        [(s, x, y) for s in (8, 16, 32) for y in range(size_px // s) for x in range(size_px // s)]
    )
    decoded = rows.copy()
    decoded[:, :2] = (rows[:, :2] + cells[:, 1:]) * cells[:, :1]
    decoded[:, 2:4] = np.exp(rows[:, 2:4]) * cells[:, :1]
    return decoded


@pytest.mark.parametrize("seed", range(3))
def test_rows_that_are_decoded_already_are_not_decoded_again(tmp_path, seed):
    """Of random networks as well, whose rows tell of no object."""
    rng = np.random.default_rng(seed)
    raw = raw_rows([(4, 4, 20, 30), (30, 2, 25, 34)], [0.9, 0.8])
    raw[2:20, :4] = rng.normal(0, 1, (18, 4))
    found = []
    for name, rows in (("raw", raw), ("decoded", decoded_rows(raw))):
        path = constant_model(tmp_path / f"{name}.onnx", (1, 3, 64, 64), {"o": rows[None].astype(np.float32)})
        detector = PersonBoxes(path)
        assert detector.settings["decoded"] == (name == "decoded")
        found.append(detector.find(IMAGE))
    assert len(found[0][0]) == 2
    np.testing.assert_allclose(found[1][0], found[0][0], rtol=1e-5)


def plain_demonstration(rows, scale, min_score, max_overlap):
    """YOLOX's own: of every row its likeliest class; whatever overlaps a likelier box goes; people stay."""
    boxes = []
    for x, y, w, h, sure, *classes in rows:
        label = int(np.argmax(classes))
        corners = np.array([x - w / 2, y - h / 2, x + w / 2, y + h / 2]) / np.tile(scale, 2)
        boxes.append((sure * classes[label], label, corners))
    boxes = sorted((box for box in boxes if box[0] >= min_score), key=lambda box: -box[0])
    kept = []
    for score, label, a in boxes:
        for _, _, b in kept:
            sides = np.minimum(a[2:], b[2:]) - np.maximum(a[:2], b[:2]) + 1
            common = max(sides[0], 0) * max(sides[1], 0)
            union = np.prod(a[2:] - a[:2] + 1) + np.prod(b[2:] - b[:2] + 1) - common
            if common / union > max_overlap:
                break
        else:
            kept.append((score, label, a))
    return [(score, corners) for score, label, corners in kept if label == 0]


@pytest.mark.parametrize("seed", range(8))
def test_boxes_are_those_of_yoloxs_own_demonstration(tmp_path, seed):
    """Any class suppresses, overlaps are counted with a pixel more, no box is cut at the image's border."""
    rng = np.random.default_rng(seed)
    rows = rng.uniform(0, 1, (84, 8))
    rows[:, 2:4] = rng.normal(0.5, 0.5, (84, 2))
    rows[:, 4] = rng.uniform(0, 1.2, 84)
    path = constant_model(tmp_path / "p.onnx", (1, 3, 64, 64), {"o": rows[None].astype(np.float32)})
    options = {"min_score": 0.2, "max_overlap": float(rng.uniform(0.2, 0.8))}
    boxes, scores = PersonBoxes(path, **options).find(IMAGE)
    expected = plain_demonstration(
        decoded_rows(rows.astype(np.float32).astype(float)), SCALE, *options.values()
    )
    np.testing.assert_allclose(scores, [score for score, _ in expected], rtol=1e-6)
    corners = np.array([corners for _, corners in expected])
    np.testing.assert_allclose(boxes[:, :2], corners[:, :2], atol=1e-3)
    np.testing.assert_allclose(boxes[:, :2] + boxes[:, 2:], corners[:, 2:], atol=1e-3)
    assert (corners < 0).any() and (corners[:, 2] > IMAGE.shape[1]).any()


def test_family_and_thresholds_may_be_given(tmp_path):
    path = echo_model(tmp_path / "p.onnx", 3)
    image = np.full((64, 64, 3), (10, 20, 200), np.uint8)
    assert PersonBoxes(path, family="yolox").find(image)[1] == [200]
    assert len(PersonBoxes(path, family="yolox", min_score=201).find(image)[1]) == 0
    with pytest.raises(InputError, match="expected one of: yolox, rtmdet"):
        PersonBoxes(path, family="ssd")
    facts = {fact.what: fact for fact in PersonBoxes(path, family="yolox").describe()}
    assert facts["person detector"].why == "given; option person_family"


def test_an_empty_answer_and_broken_numbers(tmp_path):
    boxes, scores = PersonBoxes(with_suppression(tmp_path / "a.onnx", np.zeros((0, 5)))).find(IMAGE)
    assert boxes.shape == (0, 4) and scores.shape == (0,)
    rows = [[9, 9, 1, 1, 0.9], [0, 0, np.inf, 9, 0.9]]
    assert len(PersonBoxes(with_suppression(tmp_path / "b.onnx", rows)).find(IMAGE)[0]) == 0
    for row in ([np.nan, 0, 9, 9, 0.9], [0, 0, 9, 9, np.nan]):
        with pytest.raises(InputError, match="output dets is NaN in places"):
            PersonBoxes(with_suppression(tmp_path / "b.onnx", [*rows, row])).find(IMAGE)


def test_boxes_apart_from_their_scores_are_refused(tmp_path):
    """A table of class scores beside one of boxes has as many rows as YOLOX's, and is not it."""
    outputs = {"scores": np.zeros((1, 84, 80), np.float32), "boxes": np.zeros((1, 84, 4), np.float32)}
    with pytest.raises(InputError, match="gives scores .1, 84, 80., boxes .1, 84, 4.; expected"):
        PersonBoxes(constant_model(tmp_path / "p.onnx", (1, 3, 64, 64), outputs))


@pytest.mark.parametrize(
    "output",
    [
        np.zeros((1, 84, 3)),
        np.zeros((2, 84, 7)),
        np.zeros((84, 7)),
        np.zeros((1, 84, 4)),
        np.zeros((1, 83, 7)),
        np.zeros(3),
    ],
)
def test_other_outputs_are_refused_in_one_line(tmp_path, output):
    path = constant_model(tmp_path / "p.onnx", (1, 3, 64, 64), {"output": output.astype(np.float32)})
    with pytest.raises(InputError) as caught:
        PersonBoxes(path)
    assert str(path) in str(caught.value) and "\n" not in str(caught.value)


def echo_model(path, channels, pixel=0):
    """Shows what it was fed: box (0, 0, 60, 60) with a pixel of input channel 0 (its x and y) as score."""
    make = helper.make_node
    nodes = [
        make("Slice", ["image", "start", "stop"], ["pixel"]),
        make("Reshape", ["pixel", "row"], ["score"]),
        make("Concat", ["box", "score"], ["dets"], axis=2),
    ]
    constants = {
        "start": np.array([0, 0, pixel, pixel]), "stop": np.array([1, 1, pixel + 1, pixel + 1]),
        "row": np.array([1, 1, 1]),
        "box": np.array([[[0, 0, 60, 60]]], np.float32),
        "weights": np.zeros((4, channels, 1, 1), np.float32),
    }  # fmt: skip
    outputs = {"dets": [1, 1, 5], "conv": [1, 4, None, None]}
    if channels == 12:
        nodes.append(make("SpaceToDepth", ["image"], ["folded"], blocksize=2))
    nodes.append(make("Conv", ["folded" if channels == 12 else "image", "weights"], ["conv"]))
    return save(path, nodes, {"image": [1, 3, 64, 64]}, outputs, constants)


def test_yolox_sees_raw_bgr_and_rtmdet_normalised_bgr(tmp_path):
    image = np.full((64, 64, 3), (10, 20, 200), np.uint8)
    yolox = PersonBoxes(echo_model(tmp_path / "yolox.onnx", 12))
    rtmdet = PersonBoxes(echo_model(tmp_path / "rtmdet.onnx", 3))
    assert (yolox.settings["family"], rtmdet.settings["family"]) == ("yolox", "rtmdet")
    np.testing.assert_allclose(yolox.find(image)[1], [200])
    np.testing.assert_allclose(rtmdet.find(image)[1], [(200 - 103.53) / 57.375], rtol=1e-6)


def test_what_lies_beside_the_image_is_grey_114(tmp_path):
    assert PersonBoxes(echo_model(tmp_path / "p.onnx", 12, pixel=63)).find(IMAGE)[1] == [114]


def test_a_box_at_the_least_score_counts_and_one_below_does_not(tmp_path):
    least = np.float32(0.3)
    rows = [
        [0, 0, 9, 9, np.nextafter(least, np.float32(1))],
        [20, 0, 29, 9, np.nextafter(least, np.float32(0))],
    ]
    assert len(PersonBoxes(with_suppression(tmp_path / "p.onnx", rows)).find(IMAGE)[0]) == 1


@pytest.mark.parametrize(("shift_px", "n"), [(11, 1), (13, 2)])
def test_of_raw_boxes_that_overlap_by_more_than_45_percent_one_remains(tmp_path, shift_px, n):
    """Boxes 32 wide, shifted by d, have (32 - d) / (32 + d) of their union in common: 0.49 and 0.42."""
    boxes = np.array([[4, 4, 32, 30], [4 + shift_px, 4, 32, 30]])
    rows = raw_rows(boxes, [0.9, 0.8])[None].astype(np.float32)
    path = constant_model(tmp_path / "p.onnx", (1, 3, 64, 64), {"output": rows})
    assert len(PersonBoxes(path).find(IMAGE)[0]) == n
