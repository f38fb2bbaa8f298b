"""Pictures as they are stored, and their rotation flags."""

import numpy as np
import pytest
from PIL import Image

from hicp_lib.core.images import as_seen, image_header, note_rotation, read_image, rotation_note

# Where a viewer shows what is stored at the top left and at the top right, by flag.
CORNERS = {
    1: ("top left", "top right"), 2: ("top right", "top left"), 3: ("bottom right", "bottom left"),
    4: ("bottom left", "bottom right"), 5: ("top left", "bottom left"), 6: ("top right", "bottom right"),
    7: ("bottom right", "top right"), 8: ("bottom left", "top left"),
}  # fmt: skip
PLACES = {"top": 0, "bottom": -1, "left": 0, "right": -1}


def write_flagged(path, flag: int, kind: str = "JPEG") -> None:
    """Grey, 60 x 40 as stored, the top left red, the top right blue."""
    pixels = np.full((40, 60, 3), 127, np.uint8)
    pixels[:20, :20], pixels[:20, 40:] = [255, 0, 0], [0, 0, 255]
    exif = Image.Exif()
    exif[0x0112] = flag
    options = {"quality": 95} if kind == "JPEG" else {"lossless": True} if kind == "WEBP" else {}
    Image.fromarray(pixels).save(path, kind, exif=exif, **options)


@pytest.mark.parametrize("kind", ["JPEG", "PNG", "WEBP"])
@pytest.mark.parametrize("flag", range(1, 9))
def test_pictures_are_read_as_stored_and_turned_as_viewers_do(tmp_path, flag, kind):
    path = tmp_path / "picture"
    write_flagged(path, flag, kind)
    assert image_header(path) == (60, 40, flag)
    stored = read_image(path)
    assert stored.shape == (40, 60, 3) and stored[0, 0, 0] > 200 and stored[0, -1, 2] > 200
    seen = as_seen(stored, flag)
    assert seen.shape == ((60, 40, 3) if flag > 4 else (40, 60, 3))
    for channel, corner in ((0, CORNERS[flag][0]), (2, CORNERS[flag][1])):
        row, column = (PLACES[word] for word in corner.split())
        other = seen[row, column, 2 - channel]
        assert seen[row, column, channel] > 200 and other < 60


@pytest.mark.parametrize("flag", [3, 6])
def test_tiff_is_turned_as_it_is_read(tmp_path, flag):
    path = tmp_path / "picture.tif"
    write_flagged(path, flag, "TIFF")
    assert image_header(path)[2] == 1
    row, column = (PLACES[word] for word in CORNERS[flag][0].split())
    assert read_image(path)[row, column].tolist() == [255, 0, 0]


def test_the_note_names_who_has_a_flag(tmp_path):
    write_flagged(tmp_path / "a.jpg", 1)
    write_flagged(tmp_path / "b.jpg", 6)
    write_flagged(tmp_path / "c.jpg", 0)  # no flag that EXIF knows
    write_flagged(tmp_path / "d.webp", 8, "WEBP")
    write_flagged(tmp_path / "e.png", 3, "PNG")
    (tmp_path / "f.jpg").write_bytes(b"no image, Exif or not")
    flagged = {}
    for path in sorted(tmp_path.iterdir()):
        note_rotation(path.read_bytes(), path.name, flagged)
    assert flagged == {"b.jpg": 6, "d.webp": 8, "e.png": 3}
    assert rotation_note(flagged).startswith("3 images have a rotation flag (EXIF; b.jpg: 6")
    assert rotation_note({}) == ""
