"""People: a posed body with skin, hair and clothes, as surfaces to render."""

from __future__ import annotations

import json
from dataclasses import dataclass, replace

import numpy as np

from hicp_lib.core.memo import memoised
from hicp_lib.simulation.appearance import clothing, fabrics, footwear, hair, skin
from hicp_lib.simulation.body.model import (
    BODY_FILE,
    REGIONS,
    Body,
    PosedBody,
    load_body,
    rest_shape,
    shape_weights,
)
from hicp_lib.simulation.rendering import mesh as g
from hicp_lib.simulation.rendering.surfaces import Material, Surface

Rng = np.random.Generator

# Body parts as the renderer numbers them: the body's regions, then the same on the right side.
RIGHT = len(REGIONS)
N_PARTS = 2 * RIGHT


@dataclass(frozen=True)
class Worn:
    """A garment, its fabric and its sewing; `collar` adds a shirt collar."""

    garment: clothing.Garment
    fabric: fabrics.Fabric
    trim: fabrics.Trim
    folds: np.ndarray
    collar: bool = False


@dataclass(frozen=True, eq=False)
class Appearance:
    """One person, whatever the pose: shape (weights over the body's shapes), colours, hair, clothes.

    `shoes` None is barefoot; `skirt` is (length in metres, flare, phase of its folds, fabric), or None.
    """

    shape: np.ndarray
    complexion: skin.Complexion
    style: hair.Style | None
    beard: hair.Style | None
    worn: list[Worn]
    skirt: tuple[float, float, float, fabrics.Fabric] | None
    shoes: footwear.Shoes | None
    seed: int


def random_appearance(rng: Rng) -> Appearance:
    """A random person: shape, skin, hair and clothes that could go together."""
    body = load_body()
    number = int(rng.integers(len(body.shape_names)))
    name = body.shape_names[number]
    woman = name.startswith(("woman", "girl"))
    traits = _traits()[name]
    weights = _blend(rng, body, number)
    tone = np.clip(0.12 + 0.24 * traits["asian"] + 0.62 * traits["african"] + rng.normal(0, 0.09), 0, 1)
    age = float(name.split("_")[1])
    complexion = skin.random_complexion(rng, float(tone), woman, age)
    style = hair.random_style(rng, woman, age)
    beard = None
    if not woman and age > 20 and rng.random() < 0.3:
        complexion = replace(complexion, stubble=0.85)
        length = rng.uniform(0.008, 0.03)
        beard = hair.Style(
            length, length, 0.45, (0.2, 0, -0.8), 0.2, 0.35, 0.01, n_locks=900, n_steps=3, width_m=0.0035
        )
    worn, skirt = _outfit(rng, woman, age)
    shoes = footwear.random_shoes(rng) if rng.random() < 0.93 else None
    return Appearance(weights, complexion, style, beard, worn, skirt, shoes, int(rng.integers(2**31)))


@memoised()
def _traits() -> dict:
    return json.loads(BODY_FILE.with_suffix(".json").read_text())["shapes"]


def _blend(rng: Rng, body: Body, number: int) -> np.ndarray:
    """A shape, with some of another of the same sex and size."""
    name = body.shape_names[number]
    alike = [
        k
        for k, other in enumerate(body.shape_names)
        if other.split("_")[0] == name.split("_")[0] and k != number
    ]
    weights = np.zeros(len(body.shape_names), np.float32)
    share = rng.uniform(0, 0.4) if alike else 0.0
    weights[number] = 1 - share
    if alike:
        weights[rng.choice(alike)] += share
    return weights


def _outfit(rng: Rng, woman: bool, age: float) -> tuple[list[Worn], tuple | None]:
    kinds = ["tshirt", "longsleeve", "shirt", "hoodie", "tank", "polo"]
    kind = rng.choice(kinds, p=[0.34, 0.2, 0.2, 0.12, 0.06, 0.08])
    top = _top(rng, kind, woman)
    worn = [top]
    skirt = None
    if woman and rng.random() < 0.22:
        fabric = top.fabric if rng.random() < 0.4 else fabrics.random_fabric(rng, 0.6)
        skirt = (rng.uniform(0.38, 0.75), rng.uniform(0.05, 0.5), rng.uniform(0, 6), fabric)
        if rng.random() < 0.4:
            worn.append(_bottom(rng, "leggings"))
    else:
        odds = [0.42, 0.28, 0.18, 0.12] if woman else [0.45, 0.37, 0.18, 0.0]
        worn.append(_bottom(rng, rng.choice(["jeans", "chinos", "shorts", "leggings"], p=odds)))
    return worn, skirt


def _top(rng: Rng, kind: str, woman: bool) -> Worn:
    fabric = fabrics.random_fabric(rng, {"hoodie": 0.9, "shirt": 0.3, "tshirt": 0.6}.get(kind, 0.6))
    if fabric.pattern is None and kind in ("tshirt", "longsleeve", "hoodie") and rng.random() < 0.5:
        fabric = replace(fabric, pattern=fabrics.printed(rng, fabric.colours))
    hem, collar, opening = rng.choice([-0.16, -0.1, -0.05]), 1.03, rng.choice([0.04, 0.07, 0.1])
    sleeve, ease, thick = 2.0, 0.010, 0.005
    trim = fabrics.Trim(0.03, rng.choice([1.0, 0.9, 0.8]))
    if kind == "tshirt":
        sleeve, ease = rng.choice([0.45, 0.55, 0.7]), rng.choice([0.008, 0.014, 0.02])
    elif kind == "polo":
        sleeve, opening, trim = rng.choice([0.5, 0.6]), 0.06, fabrics.Trim(0.025, 0.9)
    elif kind == "tank":
        sleeve, ease, opening, thick = 0.06, 0.006, 0.14, 0.004
    elif kind == "shirt":
        sleeve, ease, trim = rng.choice([1.95, 1.95, 1.3, 0.6]), 0.012, fabrics.Trim(0.02, 1.0, "buttons")
        opening = rng.choice([0.06, 0.1])
    elif kind == "hoodie":
        thick, ease, collar, opening = 0.011, 0.016, 1.06, 0.05
        trim = fabrics.Trim(0.07, 0.88, rng.choice(["none", "zip"]))
    elif kind == "longsleeve":
        sleeve, thick = rng.choice([1.95, 1.9, 1.4]), rng.choice([0.005, 0.008])
    if woman and rng.random() < 0.5:
        ease *= 0.5
    garment = clothing.Garment("top", hem, collar, sleeve, opening, thick, ease, 12)
    folds = clothing.random_folds(rng, 0.0035 + 0.15 * ease)
    return Worn(garment, fabric, trim, folds, kind in ("shirt", "polo"))


def _bottom(rng: Rng, kind: str) -> Worn:
    waist = rng.choice([0.12, 0.17])
    if kind == "leggings":
        garment = clothing.Garment(
            "bottom", rng.choice([1.9, 1.5]), waist, thickness_m=0.002, ease_m=0.0, smoothing=2
        )
        fabric = replace(fabrics.plain_fabric(rng, dark=True), crease_m=0.0005, gloss=0.03, roughness=0.6)
        return Worn(garment, fabric, fabrics.Trim(0.0), clothing.random_folds(rng, 0.0))
    end = rng.choice([0.7, 0.85, 0.95]) if kind == "shorts" else rng.choice([1.93, 2.0])
    ease = rng.choice([0.006, 0.012, 0.02])
    garment = clothing.Garment("bottom", end, waist, thickness_m=0.005, ease_m=ease, smoothing=10)
    fabric = fabrics.denim(rng) if kind == "jeans" or rng.random() < 0.2 else fabrics.plain_fabric(rng)
    return Worn(garment, fabric, fabrics.Trim(0.03, 0.93), clothing.random_folds(rng, 0.004 + 0.1 * ease))


def landmarks_at_rest(body: Body, weights: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Vertices, bone heads and keypoints (136, 3) of a shape at rest, metres, body frame."""
    rest, heads = rest_shape(body, weights)
    return rest, heads, body.sparse_keypoint_weights @ np.concatenate([rest, heads.astype(np.float32)])


@memoised(4)
def part_of_vertices(body: Body) -> np.ndarray:
    """Part number of each vertex: its region, plus `RIGHT` on the person's right side."""
    return (body.regions + RIGHT * (body.vertices_m[0, :, 1] < 0)).astype(np.int16)


@dataclass(frozen=True)
class _Fitted:
    """What stays the same of a person in all poses: sizes, where cloth is cut, paint and hair at rest."""

    rest_m: np.ndarray
    heads_m: np.ndarray
    landmarks_m: np.ndarray
    cuts: fabrics.Cuts
    paint: np.ndarray
    hair: g.Mesh | None


@memoised(4)  # those who are seen in many frames
def _fit(appearance: Appearance) -> _Fitted:
    body = load_body()
    rest, heads, landmarks = landmarks_at_rest(body, shape_weights(body, appearance.shape))
    grown = None
    if appearance.style is not None:
        grown = hair.grow(appearance.style, body, rest, landmarks, np.random.default_rng(appearance.seed))
    paint = skin.paint_coords(body, rest, landmarks)
    return _Fitted(rest, heads, landmarks, fabrics.make_cuts(landmarks), paint, grown)


@memoised()
def _always_hidden() -> tuple[np.ndarray, np.ndarray]:
    """Triangles of the body that are never seen: inside the mouth, as lips are closed; inside shoes."""
    body = load_body()
    fields = (("mouth", 0.9), ("leg", 2.06))
    mouth, feet = ((body.field(name)[body.triangles] > least).all(axis=1) for name, least in fields)
    return mouth, feet


def dress(appearance: Appearance, posed: PosedBody, person: int) -> list[Surface]:
    """Surfaces of a posed person: skin, clothes, hair."""
    body, fitted = load_body(), _fit(appearance)
    part = part_of_vertices(body)[body.triangles[:, 0]]
    mouth, feet = _always_hidden()
    surfaces, hidden = [], mouth.copy()
    layers = np.zeros(len(fitted.rest_m), np.float32)
    for worn in sorted(appearance.worn, key=lambda w: w.garment.kind):  # trousers before tops
        mesh, source = clothing.put_on(worn.garment, posed, fitted.rest_m, worn.folds, layers)
        hidden |= clothing.cut_pattern(worn.garment).hidden
        material = fabrics.cloth_material(worn.fabric, fitted.cuts, _LIMBS[worn.garment.kind], worn.trim)
        surfaces.append(Surface(mesh, material, person, part[source]))
        if worn.collar:
            surfaces.append(_collar(worn, mesh, posed, fitted.cuts, person))
    if appearance.skirt is not None:
        surfaces.append(_skirt(appearance.skirt, body, posed, fitted.cuts, person))
    if appearance.shoes is not None:
        hidden |= feet
        surfaces += _shoes(appearance.shoes, posed, person)
    surfaces.insert(0, _skin(appearance, posed, fitted.paint, ~hidden, part, person))
    if fitted.hair is not None:
        carried = hair.carry(fitted.hair, body, posed, fitted.heads_m, fitted.landmarks_m)
        surfaces.append(_hair(carried, hair.hair_material(appearance.complexion.hair), person))
    return surfaces


def _skin(appearance: Appearance, posed: PosedBody, paint, shown, part, person: int) -> Surface:
    covered = appearance.complexion.stubble * 0.3 if appearance.style is None else 1.0
    mesh = g.Mesh(posed.vertices_m, load_body().triangles[shown], posed.normals, paint)
    return Surface(mesh, skin.skin_material(appearance.complexion, covered), person, part[shown])


_LIMBS = {"top": "arms", "bottom": "legs"}


def _collar(worn: Worn, mesh: g.Mesh, posed: PosedBody, cuts: fabrics.Cuts, person: int) -> Surface:
    strip = clothing.collar(worn.garment, mesh, posed, 0.022, 0.02)
    material = fabrics.cloth_material(worn.fabric, cuts, "arms", fabrics.Trim(0.0))
    return Surface(strip, material, person, np.full(len(strip.triangles), REGIONS.index("neck"), np.int16))


def _skirt(skirt: tuple, body: Body, posed: PosedBody, cuts: fabrics.Cuts, person: int) -> Surface:
    length, flare, phase, fabric = skirt
    mesh = clothing.skirt(posed, posed.rotations[body.bone_names.index("root")], length, flare, phase)
    material = fabrics.cloth_material(fabric, cuts, "", fabrics.Trim(0.02, 0.95))
    return Surface(mesh, material, person, np.full(len(mesh.triangles), REGIONS.index("hips"), np.int16))


def _shoes(shoes: footwear.Shoes, posed: PosedBody, person: int) -> list[Surface]:
    pair = [footwear.put_on_shoe(shoes, posed, side) for side in ("left", "right")]
    n = len(pair[0].triangles)
    foot = REGIONS.index("foot")
    parts = np.repeat(np.array([foot, foot + RIGHT], np.int16), n)
    return [Surface(g.concatenate(pair), footwear.shoe_material(shoes), person, parts)]


def _hair(mesh: g.Mesh, material: Material, person: int) -> Surface:
    return Surface(mesh, material, person, np.full(len(mesh.triangles), REGIONS.index("scalp"), np.int16))
