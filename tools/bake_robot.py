"""Make data/icub_shape.npz: the appearance of an iCub, as triangles fixed to the links of data/icub.json.

    python tools/bake_robot.py [--out data]

The shapes are this project's own: tubes with rounded cross-sections, modelled around an upright robot with
hanging arms, so that covers lie just below the taxels of data/icub_skin.json. The same versions write the
same bytes.
"""

from __future__ import annotations

import argparse
from itertools import pairwise
from pathlib import Path

import numpy as np

from hicp_lib.core.files import atomic_path
from hicp_lib.core.rotations import about
from hicp_lib.robot.kinematics import load_icub
from hicp_lib.robot.posture import Posture
from hicp_lib.robot.segments import link_poses
from hicp_lib.robot.shape import SHAPE_FILE, STEP_M

COLOURS = {
    "shell": (0.78, 0.78, 0.80),
    "joint": (0.30, 0.31, 0.33),
    "hand": (0.12, 0.12, 0.13),
    "pad": (0.22, 0.23, 0.25),
    "eye": (0.92, 0.92, 0.90),
    "dark": (0.03, 0.03, 0.04),
    "mouth": (0.55, 0.12, 0.08),
}
X_ARM, Y_ARM = -0.0108, -0.1101  # of the hanging left arm's axis; x points backward, y to the right
BEND_DEG = (4, 9, 12)  # of a finger's joints, towards the palm
FINGERS = {-0.0225: 0.064, -0.0075: 0.071, 0.0075: 0.066, 0.0225: 0.055}  # offset along x: length
Part = tuple[str, str, np.ndarray, np.ndarray]  # link, colour, vertices, triangles


def tube(
    centres, half_u, half_v, u=(1, 0, 0), n_sides=14, power=2.0, cap=0.6
) -> tuple[np.ndarray, np.ndarray]:
    """A tube along centres (n, 3) with rounded ends.

    Its sections are |a/half_u|^power + |b/half_v|^power = 1, a along `u`; its ends bulge by `cap` times the
    smaller half-axis.
    """
    centres, half_u, half_v = np.array(centres, float), np.array(half_u, float), np.array(half_v, float)
    along = np.gradient(centres, axis=0)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    rings = []
    for end, sign in ((0, -1), (-1, 1)):
        for angle in np.radians([87, 52, 22])[::-sign]:
            bulge = sign * cap * min(half_u[end], half_v[end]) * np.sin(angle)
            rings.append(
                (
                    centres[end] + bulge * along[end],
                    along[end],
                    half_u[end] * np.cos(angle),
                    half_v[end] * np.cos(angle),
                )
            )
        if end == 0:
            rings += zip(centres, along, half_u, half_v, strict=True)
    turn = np.linspace(0, 2 * np.pi, n_sides, endpoint=False)
    a, b = (np.sign(wave) * np.abs(wave) ** (2 / power) for wave in (np.cos(turn), np.sin(turn)))
    vertices = []
    for centre, direction, size_u, size_v in rings:
        v = np.cross(direction, u)
        v /= np.linalg.norm(v)
        vertices.append(centre + size_u * a[:, None] * np.cross(v, direction) + size_v * b[:, None] * v)
    index = np.arange(len(rings) * n_sides).reshape(-1, n_sides)
    triangles = []
    for low, high in pairwise(index):
        low_next, high_next = np.roll(low, -1), np.roll(high, -1)
        triangles += [np.stack([low, low_next, high_next], 1), np.stack([low, high_next, high], 1)]
    return np.concatenate(vertices), np.concatenate(triangles)


def ball(centre, half, n_sides=12) -> tuple[np.ndarray, np.ndarray]:
    """An ellipsoid of half-axes along x, y, z."""
    heights = np.array(half)[2] * np.linspace(-0.87, 0.87, 6)
    ring = np.sqrt(1 - (heights / half[2]) ** 2)
    centres = np.array(centre) + np.outer(heights, [0, 0, 1])
    cap = 0.13 * half[2] / (ring[0] * min(half[:2]))
    return tube(centres, half[0] * ring, half[1] * ring, n_sides=n_sides, cap=cap)


def upright(x, y, heights, half_x, half_y, **options) -> tuple[np.ndarray, np.ndarray]:
    """A tube along z."""
    centres = np.stack(np.broadcast_arrays(x, y, heights), axis=-1)
    return tube(centres, half_x, half_y, **options)


def middle() -> list[tuple]:
    """Head, neck, torso, pelvis."""
    face = [(0.034 * side, 0.352) for side in (-1, 1)]
    eyes = [("head head", "eye", *ball((-0.066, y, z), (0.021, 0.021, 0.021), 12)) for y, z in face]
    pupils = [("head head", "dark", *ball((-0.0795, y, z), (0.0095, 0.0105, 0.0105), 8)) for y, z in face]
    brows = [
        (
            "head head",
            "mouth",
            *tube(
                [(-0.080, y - 0.014, z + 0.029), (-0.086, y, z + 0.034), (-0.080, y + 0.014, z + 0.029)],
                [0.003] * 3,
                [0.003] * 3,
                (0, 0, 1),
                6,
            ),
        )
        for y, z in face
    ]
    lips = [(-0.0775, -0.020, 0.312), (-0.0855, 0, 0.306), (-0.0775, 0.020, 0.312)]
    return [
        ("head head", "shell", *ball((-0.022, 0, 0.349), (0.066, 0.066, 0.082), 20)),
        ("head head", "hand", *ball((0.006, 0, 0.356), (0.060, 0.062, 0.078), 16)),
        *eyes,
        *pupils,
        *brows,
        ("head head", "mouth", *tube(lips, [0.003] * 3, [0.003] * 3, (0, 0, 1), 6)),
        ("head head", "shell", *ball((-0.088, 0, 0.331), (0.007, 0.006, 0.009), 8)),
        (
            "head head",
            "joint",
            *tube(
                [(-0.04, -0.02, 0.42), (-0.075, -0.024, 0.438), (-0.1, -0.025, 0.42)],
                [0.009] * 3,
                [0.004] * 3,
                (0, 1, 0),
                8,
            ),
        ),
        ("head neck_roll", "joint", *upright(-0.0155, 0, [0.215, 0.29], [0.028, 0.026], [0.028, 0.026])),
        (
            "head torso",
            "shell",
            *upright(
                -0.0055,
                0,
                [0.065, 0.078, 0.14, 0.195, 0.216, 0.226],
                [0.058, 0.0675, 0.069, 0.069, 0.060, 0.046],
                [0.070, 0.0825, 0.084, 0.084, 0.078, 0.066],
                n_sides=24,
                cap=0.25,
            ),
        ),
        ("head torso_roll", "joint", *upright(-0.003, 0, [-0.005, 0.075], [0.046, 0.046], [0.056, 0.058])),
        (
            "root",
            "shell",
            *upright(0.0, 0, [-0.075, -0.045, -0.01], [0.050, 0.058, 0.052], [0.075, 0.086, 0.070]),
        ),
    ]


def limbs() -> list[tuple]:
    """The left arm and the left leg."""
    arm = [
        ("left shoulder_pitch", "joint", *ball((X_ARM, Y_ARM + 0.006, 0.1753), (0.040, 0.045, 0.040))),
        (
            "left upper_arm",
            "shell",
            *upright(
                X_ARM,
                Y_ARM,
                [0.042, 0.053, 0.1, 0.143, 0.158],
                [0.036, 0.0429, 0.0432, 0.0429, 0.036],
                [0.036, 0.0429, 0.0432, 0.0429, 0.036],
                cap=0.4,
            ),
        ),
        ("left elbow", "joint", *ball((X_ARM, Y_ARM, 0.023), (0.033, 0.036, 0.033))),
        (
            "left forearm",
            "shell",
            *upright(
                [X_ARM, -0.0045, -0.0028, -0.0032, -0.0075, X_ARM],
                Y_ARM,
                [0.006, -0.012, -0.03, -0.065, -0.092, -0.112],
                [0.032, 0.036, 0.0382, 0.0378, 0.034, 0.022],
                [0.029, 0.0305, 0.0311, 0.0315, 0.030, 0.022],
                cap=0.3,
            ),
        ),
        (
            "left wrist",
            "joint",
            *upright(X_ARM, [Y_ARM, -0.106], [-0.110, -0.134], [0.019, 0.018], [0.017, 0.012]),
        ),
        (
            "left hand",
            "hand",
            *upright(
                X_ARM,
                -0.1062,
                [-0.126, -0.136, -0.16, -0.178, -0.186],
                [0.021, 0.028, 0.032, 0.032, 0.029],
                [0.0105, 0.0115, 0.0115, 0.0115, 0.009],
                power=3.0,
                cap=0.3,
            ),
        ),
        (
            "left hand",
            "pad",
            *upright(
                X_ARM + 0.001, -0.0966, [-0.140, -0.174], [0.021, 0.025], [0.0022, 0.0022], power=4.0, cap=0.3
            ),
        ),
        *[("left hand", "hand", *finger(offset, length)) for offset, length in FINGERS.items()],
        (
            "left hand",
            "hand",
            *tube(
                [
                    (-0.032, -0.105, -0.142),
                    (-0.050, -0.099, -0.156),
                    (-0.0565, -0.095, -0.172),
                    (-0.057, -0.091, -0.187),
                ],
                [0.0105, 0.009, 0.008, 0.007],
                [0.0105, 0.009, 0.008, 0.007],
                (0, 1, 0),
                8,
                cap=1.0,
            ),
        ),
    ]
    y = -0.068
    leg = [
        (
            "root",
            "shell",
            *upright(-0.004, y, [-0.27, -0.20, -0.09], [0.041, 0.047, 0.050], [0.041, 0.046, 0.048]),
        ),
        ("root", "joint", *ball((-0.004, y, -0.295), (0.037, 0.037, 0.037))),
        (
            "root",
            "shell",
            *upright(0.002, y, [-0.52, -0.42, -0.33], [0.033, 0.043, 0.040], [0.033, 0.040, 0.038]),
        ),
        ("root", "joint", *upright(0.005, y, [-0.57, -0.53], [0.027, 0.025], [0.027, 0.025])),
        (
            "root",
            "hand",
            *tube(
                [(0.045, y, -0.583), (-0.02, y, -0.58), (-0.105, y, -0.586)],
                [0.032, 0.036, 0.036],
                [0.016, 0.019, 0.013],
                (0, 1, 0),
                power=3.0,
            ),
        ),
    ]
    return arm + leg


def finger(offset: float, length: float) -> tuple[np.ndarray, np.ndarray]:
    """Of the hanging left hand, from its knuckle on; `offset` is along x, from the hand's middle."""
    place, points = np.array([X_ARM + offset, -0.106, -0.180]), []
    for share, bend in zip((0.42, 0.32, 0.26), np.cumsum(BEND_DEG), strict=True):
        step = share * length * (about(0, np.radians(bend)) @ [0.08 * np.sign(offset), 0, -1])
        points += [place, place + 0.85 * step]
        place = place + step
    radii = [0.0078, 0.0074, 0.0076, 0.0070, 0.0070, 0.0062]
    return tube(points, radii, radii, n_sides=8, cap=1.0)


def camera() -> tuple:
    """A RealSense D435, in the frame of its colour camera (x right, y down, z forward)."""
    body = tube(
        [(-0.012, 0, -0.012), (0.0325, 0, -0.012), (0.077, 0, -0.012)],
        [0.0125] * 3,
        [0.0125] * 3,
        (0, 1, 0),
        12,
        power=3.0,
        cap=0.5,
    )
    return ("camera", "joint", *body)


def mirrored(part: tuple) -> tuple:
    """The same on the robot's right side."""
    link, colour, vertices, triangles = part
    return link.replace("left", "right"), colour, vertices * [1, -1, 1], triangles[:, ::-1]


def bake() -> dict[str, np.ndarray]:
    """Arrays of the file."""
    T_root_links = link_poses(load_icub(), Posture())
    half = limbs()
    parts = [*middle(), *half, *map(mirrored, half), camera()]
    names, colours = list(T_root_links), list(COLOURS)
    stored: dict[str, list] = {"vertices": [], "triangles": [], "link": [], "colour": []}
    first = 0
    for link, colour, vertices, triangles in parts:
        T = np.eye(4) if link == "camera" else T_root_links[link]
        stored["vertices"].append((vertices - T[:3, 3]) @ T[:3, :3])
        stored["triangles"].append(triangles + first)
        stored["link"].append(np.full(len(vertices), names.index(link)))
        stored["colour"].append(np.full(len(vertices), colours.index(colour)))
        first += len(vertices)
    joined = {name: np.concatenate(values) for name, values in stored.items()}
    return {
        "vertices_20um": np.round(joined["vertices"] / STEP_M).astype(np.int16),
        "triangles": joined["triangles"].astype(np.uint16),
        "links": np.array(names),
        "vertex_link": joined["link"].astype(np.uint8),
        "vertex_colour": joined["colour"].astype(np.uint8),
        "colours": np.array(list(COLOURS.values()), np.float32),
    }


def main() -> None:
    """Write the file."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--out", type=Path, default=SHAPE_FILE.parent)
    arrays = bake()
    with atomic_path(parser.parse_args().out / SHAPE_FILE.name) as temporary:
        np.savez_compressed(temporary, **arrays)
    print(f"{len(arrays['vertices_20um'])} vertices, {len(arrays['triangles'])} triangles")


if __name__ == "__main__":
    main()
