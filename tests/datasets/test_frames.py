"""Rotation flags of annotated pictures, and labels outside their image."""

import json

import numpy as np
import pytest
from PIL import Image

from hicp_lib.core.errors import InputError
from hicp_lib.core.images import as_seen, read_image
from hicp_lib.core.keypoints import INDEX
from hicp_lib.datasets.subsets import create_hicp, notes
from hicp_lib.formats.annotations import read_annotations

SEEN_PX = (200, 300)  # width and height of the picture as a viewer shows it
NOSE = (100, 40)
INVERSE = {1: 1, 2: 2, 3: 3, 4: 4, 5: 5, 6: 8, 7: 7, 8: 6}


def write_set(folder, flag: int, annotated_px: tuple[int, int]):
    """A person whose nose is yellow in the picture as seen, stored turned so that `flag` turns it back."""
    seen = np.full((*SEEN_PX[::-1], 3), [0, 0, 255], np.uint8)
    seen[NOSE[1] - 8 : NOSE[1] + 8, NOSE[0] - 8 : NOSE[0] + 8] = [255, 255, 0]
    exif = Image.Exif()
    exif[0x0112] = flag
    (folder / "images").mkdir(parents=True)
    Image.fromarray(as_seen(seen, INVERSE[flag])).save(folder / "images" / "a.jpg", quality=95, exif=exif)
    points = np.zeros((17, 3))
    points[INDEX["nose"]] = [*NOSE, 2]
    points[[INDEX["left_shoulder"], INDEX["right_shoulder"], INDEX["left_ankle"]]] = [
        [140, 90, 2], [60, 90, 2], [130, 280, 2],
    ]  # fmt: skip
    person = {
        "id": 1,
        "image_id": 1,
        "category_id": 1,
        "bbox": [20, 10, 160, 280],
        "area": 30000,
        "iscrowd": 0,
    }
    image = {"id": 1, "file_name": "a.jpg", "width": annotated_px[0], "height": annotated_px[1]}
    people = [person | {"keypoints": points.ravel().tolist(), "num_keypoints": 4}]
    (folder / "a.json").write_text(json.dumps({"images": [image], "annotations": people}))
    return folder / "a.json", folder / "images"


@pytest.mark.parametrize("sizes", ["seen", "stored"])
@pytest.mark.parametrize("flag", range(1, 9))
def test_a_picture_is_turned_as_asked_or_refused(tmp_path, flag, sizes):
    stored_px = SEEN_PX[::-1] if flag > 4 else SEEN_PX
    paths = write_set(tmp_path / "in", flag, SEEN_PX if sizes == "seen" else stored_px)
    if flag > 1:
        with pytest.raises(InputError, match=rf"a.jpg: has a rotation flag \({flag}\).*--orientation"):
            create_hicp(*paths, tmp_path / "out")
    counts = create_hicp(*paths, tmp_path / "out", orientation="seen")
    assert counts["rotation_flags"] == ({"a.jpg": flag} if flag > 1 else {})
    assert counts["basic"] == {"kept": 1} and counts["outside_image"]["people"] == 0
    crop = read_annotations(tmp_path / "out" / "basic" / "annotations.json")
    u, v = crop.keypoints_px[0, INDEX["nose"]].astype(int)
    red, green, blue = read_image(tmp_path / "out" / "basic" / "images" / "000000000001.png")[v, u]
    assert red > 200 and green > 200 and blue < 60


def test_as_stored_the_pixels_stay_and_sizes_must_be_theirs(tmp_path):
    paths = write_set(tmp_path / "stored", 6, (300, 200))
    counts = create_hicp(*paths, tmp_path / "out", orientation="stored")
    # The person was annotated as seen: what does not fit the pixels as stored is counted and told.
    assert counts["outside_image"] == {"keypoints": 1, "boxes": 0, "people": 1}
    assert "1 labelled keypoints and 0 boxes, of 1 people" in notes(counts)[0]
    paths = write_set(tmp_path / "seen", 6, SEEN_PX)
    with pytest.raises(
        InputError, match="300x200 as stored, 200x300 as viewers show it, annotated as 200x300"
    ):
        create_hicp(*paths, tmp_path / "other", orientation="stored")
    paths = write_set(tmp_path / "neither", 6, (100, 100))
    for orientation in (None, "seen", "stored"):
        with pytest.raises(InputError, match="annotated as 100x100"):
            create_hicp(*paths, tmp_path / "other", orientation=orientation)


def test_another_orientation_replaces_the_crops(tmp_path):
    paths = write_set(tmp_path / "in", 3, SEEN_PX)
    crops = []
    for orientation in ("seen", "stored"):
        create_hicp(*paths, tmp_path / "out", orientation=orientation)
        crops.append(read_image(tmp_path / "out" / "basic" / "images" / "000000000001.png"))
    assert not np.array_equal(*crops)


def test_boxes_that_lie_mostly_outside_are_counted(tmp_path):
    annotations, images = write_set(tmp_path / "in", 1, SEEN_PX)
    data = json.loads(annotations.read_text())
    data["annotations"][0] |= {"bbox": [120, 10, 170, 280]}
    annotations.write_text(json.dumps(data))
    counts = create_hicp(annotations, images, tmp_path / "out")
    assert counts["outside_image"] == {"keypoints": 0, "boxes": 1, "people": 1}


def test_a_face_that_may_have_stayed_is_told(tmp_path):
    annotations, images = write_set(tmp_path / "in", 1, SEEN_PX)
    create_hicp(annotations, images, tmp_path / "out")
    headless = read_annotations(tmp_path / "out" / "headless" / "annotations.json")
    assert headless.extras[0]["cut_rule"] == "shoulders"
    data = json.loads(annotations.read_text())
    for name in ("left_shoulder", "right_shoulder"):
        data["annotations"][0]["keypoints"][3 * INDEX[name] + 2] = 0
    annotations.write_text(json.dumps(data))
    counts = create_hicp(annotations, images, tmp_path / "out")
    assert counts["headless_cut_by"]["head labels only"] == 1
    assert notes(counts)[0].startswith("1 Headless crops may show a part of the face")
