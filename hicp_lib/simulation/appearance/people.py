"""People: a posed body with skin, hair and clothes, as surfaces to render."""

from dataclasses import dataclass, replace

import numpy as np

from hicp_lib.core.memo import memoised
from hicp_lib.simulation.appearance import clothing, fabrics, footwear, hair, hair_styles, skin
from hicp_lib.simulation.body.identities import PEOPLE, Identity, Rng, is_woman, traits
from hicp_lib.simulation.body.model import REGIONS, Body, PosedBody, load_body, rest_shape
from hicp_lib.simulation.rendering import mesh as g
from hicp_lib.simulation.rendering.surfaces import Material, Surface

# Body parts as the renderer numbers them: the body's regions, then the same on the right side.
RIGHT = len(REGIONS)


@dataclass(frozen=True)
class Worn:
    """A garment with its fabric and details.

    Attributes
    ----------
    garment : clothing.Garment
    fabric : fabrics.Fabric
    trim : fabrics.Trim
    folds : array, shape (n_waves, 5)
        See `clothing.put_on`.
    collar : bool
        Whether it has a shirt collar.
    """

    garment: clothing.Garment
    fabric: fabrics.Fabric
    trim: fabrics.Trim
    folds: np.ndarray
    collar: bool = False


Skirt = tuple[float, float, float, fabrics.Fabric]
"""Length (m), how much wider than the legs the hem is (a share), phase of its folds (radians), fabric."""


@dataclass(frozen=True, eq=False)
class Appearance:
    """A person's appearance in any pose: shape, colours, hair, clothes.

    Attributes
    ----------
    shape : str
        Name of the body's shape.
    complexion : skin.Complexion
    style : hair_styles.Style or None
        Of the hair; None is bald.
    worn : list of Worn
    skirt : Skirt or None
    shoes : footwear.Shoes or None
        None is barefoot.
    seed : int
        Of the locks of hair.
    """

    shape: str
    complexion: skin.Complexion
    style: hair_styles.Style | None
    worn: list[Worn]
    skirt: Skirt | None
    shoes: footwear.Shoes | None
    seed: int


def appearance_of(identity: Identity, skirts: bool = True) -> Appearance:
    """A plausible combination of shape, skin, hair and clothes.

    Parameters
    ----------
    identity : Identity
    skirts : bool, optional
        Whether they may wear one: it would have to drape over a seat.

    Returns
    -------
    Appearance

    Examples
    --------
    >>> from hicp_lib.simulation.body.identities import Subject
    >>> someone = appearance_of(Subject().identity, skirts=False)
    >>> someone.shape == Subject().identity.body, [worn.garment.kind for worn in someone.worn]
    (True, ['top', 'bottom'])
    """
    rng, woman, origin = identity.draw("clothes"), is_woman(identity.body), traits(identity.body)
    age = origin["age_years"]
    tone = np.clip(0.12 + 0.24 * origin["asian"] + 0.62 * origin["african"] + rng.normal(0, 0.09), 0, 1)
    complexion = skin.random_complexion(rng, float(tone), woman, age)
    style = hair_styles.random_style(rng, woman, age)
    if not woman and rng.random() < 0.3:
        complexion = replace(complexion, stubble=0.85)
    worn, skirt = _outfit(rng, woman, skirts)
    shoes = footwear.random_shoes(rng) if rng.random() < 0.93 else None
    return Appearance(identity.body, complexion, style, worn, skirt, shoes, int(rng.integers(2**31)))


_TUCKED = 0.14  # where tops end that are tucked into a skirt, below its waist
_TRIMS = {"polo": fabrics.Trim(0.025, 0.9), "shirt": fabrics.Trim(0.02, 1.0, "buttons")}


def _outfit(rng: Rng, woman: bool, skirts: bool) -> tuple[list[Worn], Skirt | None]:
    top = _top(rng, str(rng.choice(list(PEOPLE["tops"]), p=list(PEOPLE["tops"].values()))), woman)
    if not (woman and skirts and rng.random() < 0.22):
        odds = [pair[0 if woman else 1] for pair in PEOPLE["bottoms"].values()]
        return [top, _bottom(rng, str(rng.choice(list(PEOPLE["bottoms"]), p=odds)))], None
    fabric = top.fabric if rng.random() < 0.4 else fabrics.random_fabric(rng, 0.6)
    skirt = (rng.uniform(0.38, 0.75), rng.uniform(0.05, 0.5), rng.uniform(0, 6), fabric)
    tucked = replace(top, garment=replace(top.garment, start=_TUCKED))
    return [tucked, _bottom(rng, "leggings")] if rng.random() < 0.4 else [tucked], skirt


def _top(rng: Rng, kind: str, woman: bool) -> Worn:
    fabric = fabrics.random_fabric(rng, PEOPLE["unpatterned"].get(kind, 0.6))
    if fabric.pattern is None and kind in ("tshirt", "longsleeve", "hoodie") and rng.random() < 0.5:
        fabric = replace(fabric, pattern=fabrics.printed(rng))
    cut = PEOPLE["plain_top"] | {"start": rng.choice([-0.16, -0.1, -0.05])}
    cut["opening"] = rng.choice([0.04, 0.07, 0.1])
    trim = fabrics.Trim(0.03, rng.choice([1.0, 0.9, 0.8]))
    cut |= {name: rng.choice(x) if isinstance(x, list) else x for name, x in PEOPLE["top"][kind].items()}
    if kind == "hoodie":
        trim = fabrics.Trim(0.07, 0.88, rng.choice(["none", "zip"]))
    if woman and rng.random() < 0.5:
        cut["ease_m"] *= 0.5
    folds = clothing.random_folds(rng, 0.0035 + 0.15 * cut["ease_m"])
    garment = clothing.Garment("top", **cut, smoothing=12)
    return Worn(garment, fabric, _TRIMS.get(kind, trim), folds, kind in ("shirt", "polo"))


def _bottom(rng: Rng, kind: str) -> Worn:
    waist = rng.choice([0.12, 0.17])
    if kind == "leggings":
        end = rng.choice([1.9, 1.5])
        garment = clothing.Garment("bottom", end, waist, thickness_m=0.002, ease_m=0.0, smoothing=2)
        fabric = replace(fabrics.plain_fabric(rng, dark=True), crease_m=0.0005)
        return Worn(garment, fabric, fabrics.Trim(0.0), clothing.random_folds(rng, 0.0))
    end = rng.choice([0.7, 0.85, 0.95]) if kind == "shorts" else rng.choice([1.93, 2.0])
    ease = rng.choice([0.006, 0.012, 0.02])
    garment = clothing.Garment("bottom", end, waist, thickness_m=0.005, ease_m=ease, smoothing=10)
    fabric = fabrics.denim(rng) if kind == "jeans" or rng.random() < 0.2 else fabrics.plain_fabric(rng)
    return Worn(garment, fabric, fabrics.Trim(0.03, 0.93), clothing.random_folds(rng, 0.004 + 0.1 * ease))


@memoised(4)
def part_of_vertices(body: Body) -> np.ndarray:
    """Part of each vertex, int16, shape (n_v,): its region, plus `RIGHT` on the person's right side."""
    return (body.regions + RIGHT * (body.vertices_m[0, :, 1] < 0)).astype(np.int16)


@memoised(64)
def _measured(shape: str) -> tuple[np.ndarray, np.ndarray, np.ndarray, fabrics.Panels]:
    """Of a shape at rest: vertices, bone heads, keypoints, panels of cloth."""
    body = load_body()
    rest, heads = rest_shape(body, shape)
    landmarks = body.keypoint_weights @ np.concatenate([rest, heads.astype(np.float32)])
    return rest, heads, landmarks, fabrics.make_panels(landmarks)


@memoised(4)  # for people who are seen in many frames
def _fit(appearance: Appearance) -> tuple[np.ndarray, g.Mesh | None]:
    """What is the same for a person in all poses: paint, and hair at rest."""
    body = load_body()
    rest, _, landmarks, _ = _measured(appearance.shape)
    paint, rng = skin.paint_coords(body, rest, landmarks), np.random.default_rng(appearance.seed)
    return paint, hair.grow(appearance.style, body, rest, landmarks, rng) if appearance.style else None


@memoised()
def _beyond(field: str, least: float) -> np.ndarray:
    """Whether all corners of each of the body's triangles lie beyond a value of one of its fields."""
    body = load_body()
    return (body.field(field)[body.triangles] > least).all(axis=1)


_LIMBS = {"top": "arms", "bottom": "legs"}


def dress(appearance: Appearance, posed: PosedBody, person: int) -> list[Surface]:
    """Surfaces of a posed person: skin, clothes, hair.

    Parameters
    ----------
    appearance : Appearance
    posed : PosedBody
        Of the appearance's shape.
    person : int
        Index of the person.

    Returns
    -------
    list of Surface
        In the frame of the posed person.
    """
    body, (paint, grown) = load_body(), _fit(appearance)
    rest, heads, landmarks, panels = _measured(appearance.shape)
    part = part_of_vertices(body)[body.triangles[:, 0]]
    surfaces, hidden = [], _beyond("mouth", 0.9).copy()  # lips are closed
    layers = np.zeros(len(rest), np.float32)
    for worn in sorted(appearance.worn, key=lambda w: w.garment.kind):  # trousers before tops
        mesh = clothing.put_on(worn.garment, posed, rest, worn.folds, layers)
        pattern = clothing.cut_pattern(worn.garment)
        hidden |= pattern.hidden
        material = fabrics.cloth_material(worn.fabric, panels, _LIMBS[worn.garment.kind], worn.trim)
        surfaces.append(Surface(mesh, material, person, part[pattern.source]))
        if worn.collar:
            strip = clothing.collar(worn.garment, mesh, posed, 0.022, 0.02)
            surfaces.append(_of_region("neck", strip, material, person))
    if appearance.skirt is not None:
        *cut, fabric = appearance.skirt
        material = fabrics.cloth_material(fabric, panels, "", fabrics.Trim(0.02, 0.95))
        surfaces.append(_of_region("hips", clothing.skirt(posed, layers, *cut), material, person))
    if appearance.shoes is not None:
        hidden |= _beyond("leg", 2.06)
        surfaces.append(_shoes(appearance.shoes, posed, person))
    surfaces.insert(0, _skin(appearance, posed, paint, ~hidden, part, person))
    if grown is not None:
        carried = hair.carry(grown, body, posed, heads, landmarks)
        surfaces.append(_of_region("scalp", carried, hair.hair_material(appearance.complexion.hair), person))
    return surfaces


def _of_region(region: str, mesh: g.Mesh, material: Material, person: int) -> Surface:
    return Surface(mesh, material, person, np.full(len(mesh.triangles), REGIONS.index(region), np.int16))


def _skin(appearance: Appearance, posed: PosedBody, paint, shown, part, person: int) -> Surface:
    covered = appearance.complexion.stubble * 0.3 if appearance.style is None else 1.0
    mesh = g.Mesh(posed.vertices_m, load_body().triangles[shown], posed.normals, paint)
    return Surface(mesh, skin.skin_material(appearance.complexion, covered), person, part[shown])


def _shoes(shoes: footwear.Shoes, posed: PosedBody, person: int) -> Surface:
    pair = [footwear.put_on_shoe(shoes, posed, side) for side in ("left", "right")]
    foot = REGIONS.index("foot")
    parts = np.repeat(np.array([foot, foot + RIGHT], np.int16), len(pair[0].triangles))
    return Surface(g.concatenate(pair), footwear.shoe_material(shoes), person, parts)
