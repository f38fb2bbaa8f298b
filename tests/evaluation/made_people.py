"""People and detections made up for the evaluation's tests."""

import numpy as np

from hicp_lib.core.detections import Detections
from hicp_lib.core.keypoints import HEAD, INDEX, N_KEYPOINTS
from hicp_lib.formats.annotations import Annotations, ImageInfo

# A person in a source image; the crop starts at (100, 200) and shows what is below the head.
POINTS = np.random.default_rng(3).uniform([120, 220], [700, 600], (N_KEYPOINTS, 2))
POINTS[HEAD] = np.random.default_rng(4).uniform([300, 150], [400, 190], (len(HEAD), 2))
CROP = [100, 200, 740, 680]
HIDDEN, UNKNOWN = INDEX["left_wrist"], INDEX["right_ankle"]


def make_annotations(keypoints_px, image_ids, *, visibility=None, areas_px2=20_000.0, boxes_px=None, crowd=(),
                     extras=None, n_images=None, first_id=1) -> Annotations:  # fmt: skip
    """People with given keypoints (n, 136, 2); all labelled unless said otherwise."""
    keypoints_px = np.array(keypoints_px, dtype=float).reshape(-1, 136, 2)
    n = len(keypoints_px)
    visibility = np.full((n, 136), 2.0) if visibility is None else np.array(visibility, dtype=float)
    ids = range(n_images) if n_images else sorted({int(i) for i in image_ids})
    if boxes_px is None:
        corner = keypoints_px.min(axis=1, initial=np.inf)
        boxes_px = np.concatenate([corner, keypoints_px.max(axis=1, initial=-np.inf) - corner], axis=1)
    return Annotations(
        {int(i): ImageInfo(int(i), f"{i}.png", 640, 480) for i in ids},
        np.arange(first_id, first_id + n), np.array(image_ids, dtype=np.int64),
        np.array(boxes_px, dtype=float).reshape(-1, 4), np.zeros(n) + areas_px2,
        np.isin(np.arange(n), crowd), np.where(visibility[..., None] > 0, keypoints_px, np.nan), visibility,
        extras or [{} for _ in range(n)],
    )  # fmt: skip


def make_detections(keypoints_px, person_scores=None) -> Detections:
    """Detections with given keypoints (n, 136, 2), NaN where not given; other keypoints score 0.5."""
    keypoints_px = np.array(keypoints_px, dtype=float).reshape(-1, 136, 2)
    scores = np.where(np.isfinite(keypoints_px).all(axis=-1), 0.5, 0.0)
    n = len(keypoints_px)
    return Detections(keypoints_px, scores, np.ones(n) if person_scores is None else np.array(person_scores))


def make_scene(seed: int, n_images: int = 40) -> tuple[Annotations, dict[int, Detections]]:
    """Images with 0-3 people, some unlabelled or crowds, and detections from perfect to nonsense."""
    rng = np.random.default_rng(seed)
    image_ids = np.repeat(np.arange(n_images), rng.integers(0, 4, n_images))
    n = len(image_ids)
    people = rng.uniform(50, 400, (n, 1, 2)) + rng.normal(0, 60, (n, 136, 2))
    visibility = rng.choice([0.0, 1.0, 2.0], (n, 136)) * (rng.random((n, 1)) > 0.15)
    visibility[:, 94:] *= rng.random((n, 1)) > 0.4
    annotations = make_annotations(
        people, image_ids, visibility=visibility, areas_px2=rng.uniform(5_000, 60_000, n), n_images=n_images,
        crowd=np.flatnonzero(rng.random(n) < 0.05),
    )  # fmt: skip
    detections = {}
    for i in range(n_images):
        copies = people[image_ids == i]
        copies = copies + rng.normal(0, 1, copies.shape) * rng.choice([0.5, 4, 12, 30], (len(copies), 1, 1))
        strangers = rng.uniform(0, 500, (rng.integers(0, 3), 136, 2))
        found = np.concatenate([copies, strangers])
        detections[i] = make_detections(found, np.round(rng.random(len(found)), 2))
    return annotations, detections


def make_world():
    """Source annotations; the same person in Headless; a detection that is right, also outside."""
    source_flags = np.full((1, N_KEYPOINTS), 2.0)
    source_flags[0, UNKNOWN] = 0
    source = make_annotations(POINTS[None], [7], visibility=source_flags, first_id=5)
    flags = source_flags.copy()
    flags[0, HEAD], flags[0, HIDDEN] = 0, 1
    about = {"source_id": 5, "source_image_id": 7, "crop_px": CROP, "cut_side": "top"}
    truth = {"headless": make_annotations(POINTS[None] - CROP[:2], [5], visibility=flags, extras=[about])}
    found = {("headless", "mediapipe-pose"): {5: make_detections(POINTS[None] - CROP[:2])}}
    return source, truth, found
