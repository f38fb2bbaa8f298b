"""Doses: the same person, pose and room, with one factor varied and everything else fixed.

A person stands in the laboratory in front of a horizontal camera at `EYE_M` above the floor. Every picture
shows one dose at one level:

- "distance": of the camera, in metres. The lens is fixed, so a near camera sees less of the person.
- "light": a fraction of the laboratory's. The camera compensates for it by amplification: shot noise grows
  with the root of the missing light, read noise in proportion.
- "hidden": a board in front of the person, out of reach, occludes this fraction of their height from below.
- "resolution": height of the picture in pixels, of the same view, by down-sampling.
- "upper part", "lower part": the fraction of the person's height in the picture, from the head down and from
  the feet up; cut from the same picture.

The area in the annotations, the s² of OKS, is that of the whole unhidden person at the picture's scale, so
that the same error in body sizes counts the same at every level.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import cv2
import numpy as np

from hicp_lib.core.cache import key
from hicp_lib.core.executor import run_jobs
from hicp_lib.core.files import cache_dir
from hicp_lib.core.images import write_png
from hicp_lib.datasets.crops import inside, whole_pixel_boxes
from hicp_lib.experiments.laboratory import MOVEMENTS, PHOTOGRAPHIC, facing_robot, furnished
from hicp_lib.formats.annotations import Annotations, ImageInfo, write_annotations
from hicp_lib.simulation.appearance import materials as m
from hicp_lib.simulation.appearance.people import appearance_of, dress
from hicp_lib.simulation.body.identities import Subject
from hicp_lib.simulation.body.model import PosedBody, load_body, pose_body
from hicp_lib.simulation.body.poses import sample_pose
from hicp_lib.simulation.rendering import mesh as g
from hicp_lib.simulation.rendering.camera import PlacedCamera, look_at
from hicp_lib.simulation.rendering.colour_sensor import Sensor, expose
from hicp_lib.simulation.rendering.render import Frame, World, render
from hicp_lib.simulation.rendering.surfaces import Surface
from hicp_lib.simulation.world.visibility import keypoint_visibility

LEVELS: dict[str, list[float]] = MOVEMENTS["doses"]
DISTANCE_M, EYE_M = 2.5, 1.3
_UNCHANGED = {"distance": DISTANCE_M, "light": 1.0, "hidden": 0.0, "resolution": 640}  # unmodified
_KEY_LENGTH = 16  # of a data set's folder
_WIDTH_PX, _HEIGHT_PX, _FOCAL_PX = 480, 640, 560.0
_PERSON_Y_M, _BOARD_M, _BOARD_HALF_M = 1.2, 0.85, 0.6
_SIDE_MARGIN = 0.1  # of the person's height, left and right of a cut-out part
_POSES = ("standing", "reaching", "reaching_both", "pointing", "raised", "hips")


@dataclass(frozen=True)
class Picture:
    """A picture of one person with ground truth.

    Attributes
    ----------
    image : array, shape (height, width, 3), dtype uint8
        RGB.
    mask : array of bool, shape (height, width)
        The person's pixels.
    keypoints_px : array, shape (136, 2)
    visibility : array of int, shape (136,)
        0 outside, 1 hidden, 2 visible.
    area_px2 : float
        Of the whole unhidden person at this scale.
    """

    image: np.ndarray
    mask: np.ndarray
    keypoints_px: np.ndarray
    visibility: np.ndarray
    area_px2: float


def open_doses(n_people: int = 10, seed: int = 0) -> Path:
    """Dataset folder (`images/`, `annotations.json`) of all doses; rendered first if not cached.

    People in the annotations have the keys `dose`, `level`, and `source_image_id`, the number of the person.
    """
    folder = cache_dir() / "doses" / key([open_doses], n_people=n_people, seed=seed)[:_KEY_LENGTH]
    if not (folder / "annotations.json").is_file():
        subjects = [Subject(seed, number) for number in range(n_people)]
        people = dict(run_jobs([(s, partial(_write_person, subject=s)) for s in subjects], folder=folder))
        rows = [row for subject in subjects for row in people[subject]]
        write_annotations(folder / "annotations.json", _joined(rows))
    return folder


def doses(subject: Subject) -> Iterator[tuple[str, float, Picture]]:
    """All pictures of one person: dose, level and picture."""
    person, world = _stage(subject)
    base_frame, base = _photograph(person, world, DISTANCE_M, subject)
    taken: dict[str, Callable[[float], Picture]] = {
        "distance": lambda level: _at_distance(person, world, level, base, subject),
        "light": lambda level: replace(base, image=_developed(base_frame, _dim(level), subject)),
        "hidden": lambda level: _hidden(person, world, level, base, subject),
        "resolution": lambda level: _smaller(base, level / _HEIGHT_PX),
        "upper part": lambda level: _part(base, level, from_above=True),
        "lower part": lambda level: _part(base, level, from_above=False),
    }
    for dose, levels in LEVELS.items():
        for level in levels:
            yield dose, level, base if level == _UNCHANGED.get(dose) else taken[dose](level)


def _stage(subject: Subject) -> tuple[PosedBody, World]:
    body, appearance = load_body(), appearance_of(subject.identity, skirts=False)
    rng = subject.identity.draw("poses")
    pose = sample_pose(rng, body, str(rng.choice(_POSES)), appearance.shape)
    person = pose_body(body, appearance.shape, pose, facing_robot(_PERSON_Y_M))
    free = [(0.0, y, 0.7) for y in np.linspace(_PERSON_Y_M - LEVELS["distance"][-1], _PERSON_Y_M, 8)]
    return person, furnished(subject.identity, dress(appearance, person, 0), free)


def _camera(distance_m: float) -> PlacedCamera:
    eye = np.array([0.0, _PERSON_Y_M - distance_m, EYE_M])
    pose = look_at(eye, eye + [0, 1, 0])
    centre = (_WIDTH_PX - 1) / 2, (_HEIGHT_PX - 1) / 2
    return PlacedCamera(_WIDTH_PX, _HEIGHT_PX, _FOCAL_PX, _FOCAL_PX, *centre, pose)


def _photograph(
    person: PosedBody, world: World, distance_m: float, subject: Subject
) -> tuple[Frame, Picture]:
    camera = _camera(distance_m)
    frame = render(world, camera)
    pixels, seen = keypoint_visibility(frame.rays, camera, person.keypoints_m, 0)
    mask = frame.person == 0
    return frame, Picture(_developed(frame, PHOTOGRAPHIC, subject), mask, pixels, seen, float(mask.sum()))


def _developed(frame: Frame, sensor: Sensor, subject: Subject) -> np.ndarray:
    return expose(frame.radiance, sensor, subject.stream(), frame.person >= 0)


def _dim(light: float) -> Sensor:
    shot, read = PHOTOGRAPHIC.shot_noise / np.sqrt(light), PHOTOGRAPHIC.read_noise / light
    return replace(PHOTOGRAPHIC, shot_noise=shot, read_noise=read)


def _at_distance(person, world, distance_m: float, base: Picture, subject: Subject) -> Picture:
    _, picture = _photograph(person, world, distance_m, subject)
    return replace(picture, area_px2=base.area_px2 * (DISTANCE_M / distance_m) ** 2)


def _hidden(person, world, share: float, base: Picture, subject: Subject) -> Picture:
    """A board whose upper edge appears at the given fraction of the person's height above their feet."""
    rows = np.flatnonzero(base.mask.any(axis=1))
    edge_px = rows[-1] - share * (rows[-1] - rows[0])
    depth_m = DISTANCE_M - _BOARD_M
    top_m = EYE_M - (edge_px - (_HEIGHT_PX - 1) / 2) / _FOCAL_PX * depth_m
    y = _PERSON_Y_M - _BOARD_M
    box = g.box([-_BOARD_HALF_M, y, 0], [_BOARD_HALF_M, y + 0.02, top_m])
    board = Surface(box, m.plain(m.any_colour(subject.stream())))
    _, picture = _photograph(person, replace(world, surfaces=[*world.surfaces, board]), DISTANCE_M, subject)
    return replace(picture, area_px2=base.area_px2)


def _smaller(base: Picture, scale: float) -> Picture:
    size = round(_WIDTH_PX * scale), round(_HEIGHT_PX * scale)
    factor = np.array(size) / [_WIDTH_PX, _HEIGHT_PX]
    image = cv2.resize(base.image, size, interpolation=cv2.INTER_AREA)
    mask = cv2.resize(base.mask.astype(np.float32), size, interpolation=cv2.INTER_AREA) > 0.5
    keypoints_px = (base.keypoints_px + 0.5) * factor - 0.5
    return Picture(image, mask, keypoints_px, base.visibility, base.area_px2 * factor.prod())


def _part(base: Picture, share: float, from_above: bool) -> Picture:
    box = _bounds(base.mask)
    margin, kept = _SIDE_MARGIN * box[3], share * box[3]
    top = box[1] if from_above else box[1] + box[3] - kept
    cut = np.array([[box[0] - margin, top, box[2] + 2 * margin, kept]])
    crop = whole_pixel_boxes(cut, np.array([_WIDTH_PX]), np.array([_HEIGHT_PX]))[0]
    left, above, right, below = map(int, crop)
    shown = inside(base.keypoints_px, (left, above, right, below))
    window = slice(above, below), slice(left, right)
    image, mask, visible = base.image[window], base.mask[window], np.where(shown, base.visibility, 0)
    moved_px = base.keypoints_px - [left, above]
    return replace(base, image=image, mask=mask, keypoints_px=moved_px, visibility=visible)


def _bounds(mask: np.ndarray) -> np.ndarray:
    """x, y, width, height of a mask; zeros where it is empty."""
    return np.array(cv2.boundingRect(mask.astype(np.uint8)), float)


def _write_person(folder: Path, subject: Subject) -> list[tuple]:
    """Writes one person's pictures; a row for each: file name, person, dose, level, sizes, truth."""
    rows = []
    for dose, level, picture in doses(subject):
        name = f"{subject.number:03d}_{dose.replace(' ', '_')}_{level:g}.png"
        write_png(folder / "images" / name, np.ascontiguousarray(picture.image))
        about = {"source_image_id": subject.number, "dose": dose, "level": float(level)}
        keypoints = np.where(picture.visibility[:, None] > 0, picture.keypoints_px, np.nan)
        size, box = picture.image.shape[1::-1], _bounds(picture.mask)
        rows.append((name, size, about, box, picture.area_px2, keypoints, picture.visibility))
    return rows


def _joined(rows: list[tuple]) -> Annotations:
    names, sizes, about, boxes, areas, keypoints, visibility = zip(*rows, strict=True)
    ids = np.arange(1, len(rows) + 1)
    numbered = enumerate(zip(names, sizes, strict=True), start=1)
    images = {k: ImageInfo(k, name, *size) for k, (name, size) in numbered}
    return Annotations(
        images, ids, ids, np.array(boxes), np.array(areas), np.zeros(len(rows), bool),
        np.array(keypoints), np.array(visibility, float), list(about),
    )  # fmt: skip
