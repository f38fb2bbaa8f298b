"""Sample shapes of hands from the body model, with randomly bent fingers.

    python tools/measure_hands.py [--out data/hand_shapes.npz]

The hand shapes of the robust lifting, from the development body with the median palm size. Every finger bends
independently and uniformly within the limits of its joints, its end joint with the one before; the poses of
rendered people are not used. Seeds are fixed: the same body model gives the same shapes.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from hicp_lib.core.files import atomic_path
from hicp_lib.core.keypoints import RIGHT_HAND
from hicp_lib.lifting.hand_shapes import PALM
from hicp_lib.simulation.body.identities import split_members
from hicp_lib.simulation.body.joints import FINGERS, LIMITS_DEG, pose_from_joints
from hicp_lib.simulation.body.model import Body, load_body, pose_body

N_SHAPES = 60
THUMB = ("thumb_base", "thumb_spread", "thumb_knuckle", "thumb_end")
END_FOLLOWS, END_JITTER_DEG = 0.6, 8.0  # the end joint bends by this share of the middle one
DEFAULT_OUT = Path(__file__).parents[1] / "data" / "hand_shapes.npz"


def bent_at_random(rng: np.random.Generator) -> dict[str, float]:
    """Angles of a right hand's joints, degrees."""
    angles = {joint: rng.uniform(*LIMITS_DEG[f"right_{joint}"]) for joint in THUMB}
    for finger in FINGERS:
        for joint in ("knuckle", "middle"):
            angles[f"{finger}_{joint}"] = rng.uniform(*LIMITS_DEG[f"right_{finger}_{joint}"])
        end = END_FOLLOWS * angles[f"{finger}_middle"] + rng.normal(0, END_JITTER_DEG)
        angles[f"{finger}_end"] = np.clip(end, *LIMITS_DEG[f"right_{finger}_end"])
        spread = rng.uniform(*LIMITS_DEG[f"right_{finger}_spread"])
        angles[f"{finger}_spread"] = 0.0 if finger == "middle" else spread
    return {f"right_{joint}": float(np.radians(angle)) for joint, angle in angles.items()}


def middle_hand(body: Body) -> str:
    """The development shape whose right palm is of middle size."""
    palms = {}
    for name in split_members("development")["bodies"]:
        palm_m = pose_body(body, name, {}).keypoints_m[RIGHT_HAND][PALM]
        palms[name] = np.linalg.norm(palm_m - palm_m.mean(axis=0), axis=1).mean()
    return sorted(palms, key=palms.__getitem__)[len(palms) // 2]


def hand_shapes_m(body: Body, rng: np.random.Generator) -> np.ndarray:
    """Right hands, (N_SHAPES, 21, 3), about the middle of the palm, palms turned alike."""
    name, shapes = middle_hand(body), []
    for _ in range(N_SHAPES):
        pose = pose_from_joints(bent_at_random(rng))
        hand_m = pose_body(body, name, pose).keypoints_m[RIGHT_HAND]
        hand_m = hand_m - hand_m[PALM].mean(axis=0)
        turn, _ = Rotation.align_vectors((shapes or [hand_m])[0][PALM], hand_m[PALM])
        shapes.append(turn.apply(hand_m))
    return np.array(shapes)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=DEFAULT_OUT)
    out = parser.parse_args().out
    tenths_mm = np.rint(10_000 * hand_shapes_m(load_body(), np.random.default_rng(5))).astype(np.int16)
    with atomic_path(out) as temporary:
        np.savez_compressed(temporary, shapes_tenth_mm=tenths_mm)


if __name__ == "__main__":
    main()
