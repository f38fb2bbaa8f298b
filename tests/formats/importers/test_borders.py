"""What importers just allow, and what they just refuse."""

import json
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from native_files import write_mmpose, write_openpose

from hicp_lib.core.errors import InputError
from hicp_lib.core.keypoints import BODY
from hicp_lib.formats.importers.importing import import_predictions
from hicp_lib.formats.importers.matching import ImageMatcher
from hicp_lib.formats.importers.openpose import refuse_other_size
from hicp_lib.formats.importers.people import People
from hicp_lib.formats.importers.scores import score_scale
from tests.formats.importers.native_people import NAMES, annotated, make_person

PATH = Path("predictions.json")
SIZE_PX = np.array([[640.0, 480.0]])


def people(highest: float = 0.5, named_by="stem", sources=("a",)) -> People:
    n = len(sources)
    scores = np.full((n, 136), highest)
    return People(
        Path("p.json"), named_by, list(sources), np.arange(n), np.zeros((n, 136, 2)), scores, np.ones(n),
        Counter(), [{}] * n,
    )  # fmt: skip


@pytest.mark.parametrize("format", ["openpose", "alphapose", "detectron2"])
def test_scores_of_formats_that_rtmw_does_not_write_may_pass_1_a_little(format):
    assert score_scale(format, people(1.0)) == score_scale(format, people(2.0)) == 1
    with pytest.raises(
        InputError, match="go up to 2.1; give --score-scale, the score that is to become 1, the"
    ):
        score_scale(format, people(2.1))


@pytest.mark.parametrize("format", ["mmpose", "coco"])
def test_rtmws_scale_is_never_taken_for_another_in_the_next_folder(format):
    """Of one detector 4, 1.6 and 0.9 are found in three folders."""
    assert score_scale(format, people(1.0)) == 1
    for highest in (np.nextafter(1.0, 2), 1.6, 4.0, 20.0):
        with pytest.raises(InputError, match="10 if RTMW wrote them"):
            score_scale(format, people(highest))
    with pytest.raises(
        InputError, match="go up to 20.5; give --score-scale, the score that is to become 1, the"
    ):
        score_scale(format, people(20.5))


@pytest.mark.parametrize(("edge_px", "fine"), [((672, 504), True), ((673, 504), False), ((672, 505), False)])
def test_a_twentieth_of_the_image_is_padding(edge_px, fine):
    points = np.full((1, 136, 2), 100.0)
    points[0, BODY] = edge_px
    points[0, 26:] = 5_000  # face and hands are not looked at
    if fine:
        refuse_other_size(Path("o"), points, SIZE_PX)
    else:
        with pytest.raises(InputError, match="26 of 26 body parts lie outside"):
            refuse_other_size(Path("o"), points, SIZE_PX)


def test_one_body_part_in_ten_may_lie_outside():
    points = np.full((10, 136, 2), 100.0)
    points[:, BODY[20:]] = np.nan
    points[:, BODY[:2]] = 5_000
    refuse_other_size(Path("o"), points, SIZE_PX.repeat(10, axis=0))
    points[0, BODY[2]] = 5_000
    with pytest.raises(InputError, match="21 of 200 body parts lie outside"):
        refuse_other_size(Path("o"), points, SIZE_PX.repeat(10, axis=0))


@pytest.mark.parametrize(("lowest", "highest", "span"), [(0.1, 1.0, r"\[0, 1\]"), (-0.4, 1.0, r"\[-1, 1\]")])
def test_coordinates_up_to_one_are_no_pixels(tmp_path, images, lowest, highest, span):
    points = np.full((136, 2), 0.6)
    points[100], points[101] = lowest, highest  # of a hand: half a pixel is taken off bodies
    write_openpose(tmp_path / "o", {NAMES[785]: [make_person(points_px=points)]})
    with pytest.raises(InputError, match=f"all coordinates lie in {span}; expected pixels"):
        import_predictions("openpose", tmp_path / "o", images)
    points[101] = 1.51
    write_openpose(tmp_path / "p", {NAMES[785]: [make_person(points_px=points)]})
    assert len(import_predictions("openpose", tmp_path / "p", images).detections[785]) == 1


def rewritten(folder: Path, **changes) -> None:
    """The first person of MMPose's only file, with other values."""
    path = next(folder.iterdir())
    rows = json.loads(path.read_text())
    rows[0] |= changes
    path.write_text(json.dumps(rows))


def test_mmpose_ranks_by_scores_above_a_fifth_only(tmp_path, images):
    write_mmpose(tmp_path, {NAMES[785]: [make_person()]}, "halpe136")
    rewritten(tmp_path, keypoint_scores=[0.4, 0.6, *[0.2] * 134], bbox_score=0.5)
    found = import_predictions("mmpose", tmp_path, images).detections[785]
    assert found.person_scores[0] == pytest.approx(0.5 * 0.5)
    assert found.scores[0, 5] == 0.2


def test_boxes_of_mmpose_become_corner_and_size(tmp_path, images):
    write_mmpose(tmp_path, {NAMES[785]: [make_person()]})
    rewritten(tmp_path, bbox=[[10, 20, 110, 70]])
    assert import_predictions("mmpose", tmp_path, images).extras[785][0]["bbox"] == [10, 20, 100, 50]


def test_numbers_of_eighteen_digits_name_an_image_and_longer_ones_none():
    numbers = {1: "1" * 18, 2: "2" * 19}
    images = annotated({i: f"frame_{number}_x.png" for i, number in numbers.items()}).images
    sources = (int(numbers[1]),)
    assert ImageMatcher(PATH, "number", images).match(sources) == [1]
    with pytest.raises(InputError, match="none of its 1 images is annotated"):
        ImageMatcher(PATH, "number", images).match((int(numbers[2]),))


def test_a_whole_path_goes_before_a_name_and_a_name_before_a_stem():
    images = annotated({1: "a/x.png", 2: "b/x.png", 3: "y.jpg", 4: "c/z.png"}).images
    names = ("b/x.png", "d\\y.jpg", "z.jpg", "nowhere.png")
    assert ImageMatcher(PATH, "id", images).match(names) == [2, 3, 4, None]
    with pytest.raises(InputError, match=r"'x.png' could be a/x.png and b/x.png"):
        ImageMatcher(PATH, "id", images).match(("x.png",))
