"""Skin, lips, eyes and eyebrows, painted on the body in its rest pose."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import KDTree

from hicp_lib.core.keypoints import FACE, HANDS
from hicp_lib.core.memo import memoised
from hicp_lib.simulation.appearance.materials import hsv, linear
from hicp_lib.simulation.body.identities import PEOPLE
from hicp_lib.simulation.body.model import Body
from hicp_lib.simulation.rendering import textures
from hicp_lib.simulation.rendering.surfaces import Look, Material, column

_TONES, _IRISES = (linear(PEOPLE[name]) for name in ("skin_srgb", "irises_srgb"))
_HAIR = PEOPLE["hair_hsv"]


@dataclass(frozen=True)
class Complexion:
    """One person's colours.

    Attributes
    ----------
    tone : float
        0 fairest to 1 darkest.
    warmth : float
        Shifts the skin's hue, about -1 to 1.
    hair : array, shape (3,)
        Linear RGB of hair and eyebrows.
    iris : array, shape (3,)
        Linear RGB.
    lips : float
        How much redder than skin the lips are, 0 to 1 (lipstick).
    brows, stubble, freckles : float
        Strengths, 0 to 1.
    """

    tone: float
    warmth: float
    hair: np.ndarray
    iris: np.ndarray
    lips: float = 0.2
    brows: float = 0.8
    stubble: float = 0.0
    freckles: float = 0.0


def random_complexion(rng: np.random.Generator, tone: float, woman: bool, age: float) -> Complexion:
    """Colours that go together: dark skin with dark hair and eyes, grey hair with age.

    Parameters
    ----------
    rng : numpy.random.Generator
    tone : float
        0 fairest to 1 darkest.
    woman : bool
    age : float
        Years.

    Returns
    -------
    Complexion
    """
    dark = tone > 0.42
    iris = _IRISES[rng.choice(2 if dark else 4, p=None if dark else [0.35, 0.15, 0.3, 0.2])]
    return Complexion(
        tone=tone,
        warmth=rng.normal(0, 0.5),
        hair=_hair_colour(rng, dark, age),
        iris=iris * rng.uniform(0.7, 1.2),
        lips=rng.uniform(0.3, 0.9) if woman and age > 17 and rng.random() < 0.5 else rng.uniform(0.05, 0.25),
        brows=rng.uniform(0.75, 1.0),
        stubble=0.0 if woman or age < 18 else float(rng.choice([0.0, rng.uniform(0.1, 0.5)])),
        freckles=rng.uniform(0.3, 1) if tone < 0.3 and rng.random() < 0.2 else 0.0,
    )


def _hair_colour(rng: np.random.Generator, dark: bool, age: float) -> np.ndarray:
    if age > 38 and rng.random() < (age - 35) / 35:
        grey = rng.uniform(0.35, 0.75)
        return linear(np.array([grey, grey * 0.985, grey * 0.96]))
    if dark or rng.random() < 0.25:
        return hsv(rng.uniform(0.04, 0.09), rng.uniform(0.2, 0.5), rng.uniform(0.09, 0.2))
    kind = rng.choice(len(_HAIR), p=[often for often, *_ in _HAIR])
    value = [rng.uniform(*limits) for *_, limits in _HAIR][kind]
    _, hue, saturation, _ = _HAIR[kind]
    return hsv(hue + rng.normal(0, 0.008), saturation * rng.uniform(0.8, 1.15), value)


# Columns of `paint_coords` after the rest position.
_PAINTED = ("hairline_m", "brow_m", "lash_m", "beard_m", "iris_rad", "lips", "eyelid", "nail")
COORDS = ("x", "y", "z", *_PAINTED, "eye", "mouth", "flush")


def paint_coords(body: Body, rest_m: np.ndarray, landmarks_m: np.ndarray) -> np.ndarray:
    """Coordinates per vertex for painting the skin.

    Parameters
    ----------
    body : Body
    rest_m : array, shape (n_v, 3)
        The person at rest.
    landmarks_m : array, shape (136, 3)
        The person's keypoints at rest.

    Returns
    -------
    array, shape (n_v, len(COORDS)), dtype float32
        Columns `COORDS`.
    """
    painted, head, _ = _painted(body)
    flush = np.zeros(len(rest_m), np.float32)
    p = rest_m[head].astype(np.float32)
    face = landmarks_m[FACE].astype(np.float32)
    # Cheeks lie below the outer corner of each eye, level with the nose.
    left, right = 0.55 * face[45] + 0.45 * face[54], 0.55 * face[36] + 0.45 * face[48]
    flush[head] = (
        0.8 * (_bump(p, left, 0.028) + _bump(p, right, 0.028))
        + 0.9 * _bump(p, face[30], 0.014)
        + 0.6 * body.field("ear")[head]
    )
    flush += _knuckles(body, rest_m, landmarks_m)
    return np.column_stack([rest_m, painted, flush]).astype(np.float32)


@memoised(4)
def _painted(body: Body) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """What is the same for all shapes: columns of coords (n_v, k); numbers of vertices of head and hands."""
    columns = [body.field(name) for name in _PAINTED]
    columns += [body.in_regions(name) for name in ("eye", "mouth")]
    head = np.flatnonzero(body.in_regions("face", "scalp", "eyebrow", "lips", "mouth", "neck"))
    return np.column_stack(columns).astype(np.float32), head, np.flatnonzero(body.in_regions("hand", "nail"))


def _bump(points: np.ndarray, centre: np.ndarray, width_m: float) -> np.ndarray:
    return np.exp(-((points - centre) ** 2).sum(axis=1) / width_m**2)


def _knuckles(body: Body, rest_m: np.ndarray, landmarks_m: np.ndarray) -> np.ndarray:
    red = np.zeros(len(rest_m), np.float32)
    _, _, hands = _painted(body)
    joints = landmarks_m[HANDS[np.arange(len(HANDS)) % 21 > 2]]  # without the hand's root and the thumb's
    distance_m, _ = KDTree(joints).query(rest_m[hands], distance_upper_bound=0.06)  # infinite beyond
    red[hands] = 0.25 + 0.5 * np.exp(-((distance_m / 0.010) ** 2))
    elbows, knees = (((body.field(name) - 1) / width) ** 2 for name, width in (("arm", 0.08), ("leg", 0.1)))
    return red + (0.4 * np.exp(-elbows) + 0.3 * np.exp(-knees))


def skin_material(complexion: Complexion, scalp: float) -> Material:
    """Skin with everything painted on it; `scalp` is how much hair covers the scalp, 0 to 1."""
    tone = _tone(complexion)
    red = tone * np.array([1.02, 0.72, 0.68])

    def look(coords: np.ndarray, footprint_m: np.ndarray) -> Look:
        c = dict(zip(COORDS, coords, strict=True))
        uv = np.stack([c["y"] + 0.5 * c["x"], c["z"] + 0.3 * c["x"]])
        blotches, pores, freckles = textures.sample(textures.skin, uv, footprint_m)
        flush = np.clip(c["flush"] * (0.8 + 0.1 * blotches) + 0.04 * blotches, -0.2, 1)
        flush *= 1 - 0.4 * complexion.tone
        albedo = column(tone) + (column(red) - column(tone)) * flush
        albedo *= 1 + 0.02 * blotches + 0.025 * pores
        albedo *= 1 - 0.35 * complexion.freckles * freckles * np.clip(2 * c["flush"], 0, 1)
        albedo *= 1 - 0.10 * _step(c["eyelid"], 0.4, 0.9)
        gloss, softness = 0.035 + 0.01 * pores, np.ones(len(uv[0]), np.float32)
        roughness: np.ndarray = np.full(len(uv[0]), 0.46, np.float32)
        albedo, roughness = _paint_lips(complexion, tone, albedo, roughness, c)
        albedo, bare = _paint_hair(complexion, scalp, albedo, c, uv, footprint_m)
        gloss *= 0.2 + 0.8 * bare  # hair's roots do not shine as skin does
        nail = 0.7 * _step(c["nail"], 0.3, 0.7)
        albedo = albedo * (1 - nail) + nail * column(tone * np.array([1.08, 0.92, 0.90]))
        roughness = roughness * (1 - 0.4 * nail)
        eye = c["eye"] > 0.5
        if eye.any():
            albedo[:, eye] = _eye(complexion, c["iris_rad"][eye])
            gloss[eye], roughness[eye], softness[eye] = 0.06, 0.16, 0.3
        inside = c["mouth"] > 0.7
        albedo[:, inside] = column([0.12, 0.03, 0.03])
        return Look(albedo, 0.00005 * pores, gloss, roughness, softness)

    return look


def _tone(complexion: Complexion) -> np.ndarray:
    scale = np.linspace(0, 1, len(_TONES))
    tone = np.array([np.interp(complexion.tone, scale, _TONES[:, k]) for k in range(3)])
    return tone * (1 + 0.05 * complexion.warmth * np.array([0.4, -0.2, -1.0]))


def _step(value: np.ndarray, low: float, high: float) -> np.ndarray:
    t = np.clip((value - low) / (high - low), 0, 1)
    return t * t * (3 - 2 * t)


def _paint_lips(complexion: Complexion, tone, albedo, roughness, c) -> tuple[np.ndarray, np.ndarray]:
    weight = _step(c["lips"], 0.35, 0.75)
    natural = tone * np.array([0.86, 0.55, 0.55])
    painted = natural * (1 - complexion.lips) + complexion.lips * np.array([0.40, 0.055, 0.075])
    albedo = albedo + (column(painted) - albedo) * weight
    return albedo, roughness - 0.14 * weight


def _paint_hair(complexion: Complexion, scalp, albedo, c, uv, footprint) -> tuple[np.ndarray, np.ndarray]:
    """Eyebrows, lashes, stubble and the hair's roots; and how much of the skin they leave bare."""
    hair = column(complexion.hair) * 0.7
    slanted = np.stack([uv[0] + uv[1], uv[1] * 2 - uv[0]])
    fibre = textures.sample(textures.strands, slanted, footprint)[0]
    brow = 0.9 * complexion.brows * _step(c["brow_m"] + 0.0016 * fibre, -0.003, 0.002)
    lash = 0.85 * _step(c["lash_m"], -0.0008, 0.0006)
    roots = scalp * _step(c["hairline_m"] + 0.003 * fibre, -0.003, 0.005)
    stubble = complexion.stubble * _step(c["beard_m"] + 0.001 * fibre, -0.002, 0.012)
    stubble *= 1 - _step(c["lips"], 0.2, 0.5)
    cover = 1 - (1 - brow) * (1 - roots) * (1 - stubble * (0.75 + 0.2 * fibre))
    cover = np.clip(cover, 0, 1)
    albedo = albedo + (hair * (1 + 0.3 * fibre) - albedo) * cover
    return np.clip(albedo * (1 - lash) + 0.012 * lash, 0.001, 1), 1 - cover


def _eye(complexion: Complexion, angle: np.ndarray) -> np.ndarray:
    ring = 0.55 + 0.9 * _step(angle, 0.2, 0.5) - 0.8 * _step(angle, 0.42, 0.52)
    iris = column(complexion.iris) * ring
    white = column([0.60, 0.56, 0.53]) * (1 - 0.25 * _step(angle, 0.6, 1.1))
    edge = _step(angle, 0.46, 0.56)
    colour = iris * (1 - edge) + white * edge
    return colour * _step(angle, 0.16, 0.22) + 0.003
