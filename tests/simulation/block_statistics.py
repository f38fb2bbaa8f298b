"""Small results of the simulation, and their means and standard deviations in blocks.

What is simulated looks right or wrong to the eye; numbers tell whether it looks as it did. The expected
statistics lie in `block_statistics.json`; after a change that is meant, ``python -m
tests.simulation.block_statistics`` writes them anew, and the difference is to be looked at.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable
from dataclasses import astuple
from pathlib import Path

import numpy as np

from hicp_lib.experiments import laboratory
from hicp_lib.experiments.avoidance.head_camera import robot_surfaces
from hicp_lib.experiments.avoidance.reaching import PHASES_S, SCRIPTS, script
from hicp_lib.experiments.recordings.gestures import Gestures
from hicp_lib.robot.home import HOME_M, home_posture
from hicp_lib.robot.kinematics import load_icub
from hicp_lib.simulation.appearance import (
    clothing,
    fabrics,
    footwear,
    hair,
    hair_styles,
    materials,
    people,
    skin,
)
from hicp_lib.simulation.body import arms, poses
from hicp_lib.simulation.body.identities import HELD_OUT, Subject, draw_identity
from hicp_lib.simulation.body.joints import LIMITS_DEG
from hicp_lib.simulation.body.model import load_body, pose_body, rest_shape
from hicp_lib.simulation.body.self_collision import collision_model
from hicp_lib.simulation.rendering import lights, textures
from hicp_lib.simulation.rendering.camera import PlacedCamera, look_at
from hicp_lib.simulation.rendering.colour_sensor import Sensor, expose
from hicp_lib.simulation.rendering.mesh import Mesh, quad
from hicp_lib.simulation.rendering.render import World, render
from hicp_lib.simulation.rendering.surfaces import Look, Material, Surface
from hicp_lib.simulation.world import furniture, room, staging

EXPECTED_FILE = Path(__file__).with_suffix(".json")
N_BLOCKS = 4
SHAPE = "woman_25_09"
BODY = load_body()
PARTS = ("albedo", "height_m", "gloss", "roughness", "softness", "glow")


def rngs(n: int) -> list[np.random.Generator]:
    return [np.random.default_rng([77, k]) for k in range(n)]


def statistics(values: np.ndarray) -> np.ndarray:
    """Mean and standard deviation of each column in blocks of rows; (n_blocks, 2, n_columns)."""
    rows = np.asarray(values, float).reshape(len(values), -1)
    blocks = np.array_split(rows, min(N_BLOCKS, len(rows)))
    return np.array([[block.mean(axis=0), block.std(axis=0)] for block in blocks])


def mesh(of: Mesh) -> np.ndarray:
    return np.column_stack([of.vertices_m, of.normals, of.coords])


def vertices(surfaces: Iterable[Surface]) -> np.ndarray:
    return np.concatenate([surface.mesh.vertices_m for surface in surfaces])


def looks(material: Material, n_coords: int = 2, span_m: float = 1.0) -> np.ndarray:
    """What a material looks like at 400 places, near and far: a row for each."""
    rng = np.random.default_rng(5)
    coords = rng.uniform(0, span_m, (n_coords, 400)).astype(np.float32)
    footprint_m = np.repeat(np.float32([0.0005, 0.01]), 200)
    look = material if isinstance(material, Look) else material(coords, footprint_m)
    return np.concatenate(
        [
            np.broadcast_to(getattr(look, part), (n, 400))
            for part, n in zip(PARTS, (3, 1, 1, 1, 1, 3), strict=True)
        ]
    ).T


def textures_seen() -> list[np.ndarray]:
    uv = np.random.default_rng(2).uniform(0, 2, (2, 2000)).astype(np.float32)
    plain = (
        "cloud",
        "planks",
        "wood",
        "tiles",
        "carpet",
        "plaster",
        "bricks",
        "weave",
        "wrinkles",
        "strands",
        "skin",
    )
    made = [(getattr(textures, name),) for name in plain]
    made += [(textures.dots, 0.16), (textures.stripes, 0.35)]
    made += [(pattern, k) for pattern in (textures.checks, textures.blobs) for k in range(3)]
    made += [*((textures.prints, k) for k in range(4)), (textures.picture, 3)]
    return [
        textures.sample(pattern, uv, footprint_m, *numbers).T
        for pattern, *numbers in made
        for footprint_m in (0.0002, 0.01)
    ]


def styles_drawn() -> np.ndarray:
    styles = [hair_styles.random_style(rng, k % 2 == 0, 20 + 10 * (k % 5)) for k, rng in enumerate(rngs(120))]
    numbers = [
        [
            s.top_m,
            s.side_m,
            s.lift,
            *s.comb,
            s.gravity,
            s.curl,
            s.volume_m,
            s.parting,
            len(s.tie),
            s.n_locks,
            s.n_steps,
            s.width_m,
            s.coil_m,
        ]
        if s
        else [0] * 15
        for s in styles
    ]
    return np.array(numbers, float)


def hair_grown() -> list[np.ndarray]:
    rest, heads = rest_shape(BODY, SHAPE)
    landmarks = BODY.keypoint_weights @ np.concatenate([rest, heads.astype(np.float32)])
    posed = pose_body(BODY, SHAPE, {"head": np.array([0, 0.3, 0.2])})
    styles = [
        hair_styles.Style(0.3, 0.28, gravity=1.0, parting=1.0, n_locks=300),
        hair_styles.Style(0.3, 0.3, tie="tail", n_locks=200),
        hair_styles.Style(0.3, 0.3, tie="bun", n_locks=200),
        hair_styles.Style(0.07, 0.05, coil_m=0.007, n_locks=300),
    ]
    grown = [hair.grow(style, BODY, rest, landmarks, rng) for style, rng in zip(styles, rngs(4), strict=True)]
    carried = hair.carry(grown[0], BODY, posed, heads, landmarks)
    return [*map(mesh, grown), mesh(carried), looks(hair.hair_material(np.array([0.2, 0.1, 0.05])), 4)]


def garments() -> list[np.ndarray]:
    posed = pose_body(BODY, SHAPE, {"upperarm01.L": np.array([0.6, -0.4, 0.2])})
    rest, _ = rest_shape(BODY, SHAPE)
    folds = clothing.random_folds(np.random.default_rng(3), 0.006)
    layers = np.zeros(len(rest), np.float32)
    bottom = clothing.Garment("bottom", 1.93, 0.17)
    top = clothing.Garment("top", -0.1, 1.03, 0.55, 0.07)
    worn = [clothing.put_on(garment, posed, rest, folds, layers) for garment in (bottom, top)]
    strip = clothing.collar(top, worn[1], posed, 0.022, 0.02)
    skirt = clothing.skirt(posed, layers, 0.5, 0.3, 1.0)
    hidden = np.array([[clothing.cut_pattern(garment).hidden.sum()] for garment in (bottom, top)])
    return [*map(mesh, worn), mesh(strip), mesh(skirt), layers[:, None], folds, hidden]


def cloths() -> list[np.ndarray]:
    rest, heads = rest_shape(BODY, SHAPE)
    panels = fabrics.make_panels(BODY.keypoint_weights @ np.concatenate([rest, heads.astype(np.float32)]))
    made = [fabrics.random_fabric(rng, 0.3) for rng in rngs(12)]
    made += [make(rng) for make in (fabrics.denim, fabrics.plain_fabric) for rng in rngs(2)]
    trims = [fabrics.Trim(0.03, 0.9, line) for line in ("none", "buttons", "zip")]
    rng = np.random.default_rng(4)
    coords = rng.uniform([-0.2, -0.3, 0.5, 0, 0, 0, 0], [0.2, 0.3, 1.5, 1, 1, 1, 0.1], (600, 7)).T.astype(
        np.float32
    )
    found = []
    for k, fabric in enumerate(made):
        limbs = ("arms", "legs", "")[k % 3]
        look = fabrics.cloth_material(fabric, panels, limbs, trims[k % 3])(
            coords, np.full(600, 0.001, np.float32)
        )
        found.append(np.column_stack([look.albedo.T, look.height_m]))
    chest = fabrics.printed(np.random.default_rng(0))(rng.uniform(-0.1, 0.4, (2, 600)), np.full(600, 0.001))
    numbers = [[*f.colours.ravel(), f.pattern is None, f.weave_m, f.crease_m, f.fuzz] for f in made]
    return [
        *found,
        chest.T,
        np.array(numbers, float),
        np.column_stack([panels[0], *panels[1].swapaxes(0, 1)[:2], fabrics._PANEL_RADII_M]),
    ]


def shoes() -> list[np.ndarray]:
    posed = pose_body(BODY, SHAPE, {"foot.R": np.array([0, 0.3, 0])})
    drawn = [footwear.random_shoes(rng) for rng in rngs(24)]
    numbers = np.array(
        [[*s.upper, *s.sole, s.height_m, s.thickness_m, s.laces, s.roughness] for s in drawn], float
    )
    pair = [mesh(footwear.put_on_shoe(drawn[k], posed, side)) for k, side in enumerate(("left", "right"))]
    return [
        *pair,
        numbers,
        looks(footwear.shoe_material(drawn[0]), 3, 0.08),
        looks(footwear.shoe_material(drawn[1]), 3),
    ]


def things() -> list[np.ndarray]:
    makers = (
        materials.wooden,
        materials.upholstery,
        materials.random_floor,
        materials.random_wall,
        materials.foliage,
        materials.outside,
    )
    found = [looks(make(rng)) for make in makers for rng in rngs(6)]
    white = np.array([0.8, 0.72, 0.6])
    found += [
        looks(m)
        for m in (
            materials.plain(white),
            materials.plain(white, 0.6, glow=0.5),
            materials.pictured(2),
            materials.paint(white, 0.1),
        )
    ]
    colours = [
        make(rng)
        for make in (materials.any_colour, materials.off_white, materials.wood_colour)
        for rng in rngs(30)
    ]
    return [*found, np.array(colours)]


def skins() -> list[np.ndarray]:
    rest, heads = rest_shape(BODY, SHAPE)
    coords = skin.paint_coords(
        BODY, rest, BODY.keypoint_weights @ np.concatenate([rest, heads.astype(np.float32)])
    )
    drawn = [
        skin.random_complexion(rng, 0.1 * (k % 10), k % 2 == 0, 15.0 + k) for k, rng in enumerate(rngs(60))
    ]
    numbers = [[c.tone, c.warmth, *c.hair, *c.iris, c.lips, c.brows, c.stubble, c.freckles] for c in drawn]
    rows = coords[np.argsort(BODY.regions, kind="stable")[::7]]
    footprint_m = np.full(len(rows), 0.0005, np.float32)
    seen = [skin.skin_material(c, 0.7)(rows.T, footprint_m) for c in drawn[3:7]]
    columns = [np.column_stack([s.albedo.T, s.height_m, s.gloss, s.roughness, s.softness]) for s in seen]
    return [coords, np.array(numbers), *columns]


def outfits() -> list[np.ndarray]:
    drawn = [people.appearance_of(draw_identity(rng, HELD_OUT)) for rng in rngs(40)]
    worn = [
        [*astuple(w.garment)[1:], *(w.trim.hem, w.trim.band, len(w.trim.line), w.collar)]
        for a in drawn
        for w in a.worn
    ]
    shapes = [
        [
            BODY.shape_names.index(a.shape),
            a.skirt is None,
            a.shoes is None,
            a.style is None,
            a.complexion.stubble,
            a.seed / 2**31,
        ]
        for a in drawn
    ]
    return [np.array(worn, float), np.array(shapes, float)]


def rooms() -> list[np.ndarray]:
    made = [room.make_room(rng, np.array([[0.0, 0.0, 0.8]])) for rng in rngs(6)]
    windows = np.array([np.concatenate(window) for r in made for window in r.windows])
    return [*(vertices(r.surfaces) for r in made), windows, np.array([[*r.half_m, r.height_m] for r in made])]


def pieces() -> list[np.ndarray]:
    place = np.array([0.5, -0.3, 0], np.float32)
    found = [vertices(make(rng, place, 0.4)) for make, _, _ in furniture._PIECES[:8] for rng in rngs(2)]
    sitting = pose_body(BODY, SHAPE, poses.sample_pose(np.random.default_rng(0), BODY, "sitting", SHAPE))
    stools = [vertices([furniture.stool(rng, sitting)]) for rng in rngs(3)]
    sizes = np.array([[radius, turns] for _, radius, turns in furniture._PIECES], float)
    return [*found, *stools, sizes]


def stages() -> list[np.ndarray]:
    rows = []
    for rng in rngs(8):
        person = pose_body(BODY, SHAPE, {})
        camera = staging._camera(rng, person)
        some = room.Room(
            np.array([3.0, 4.0]), 2.6, [], [(np.ones(3), np.eye(3)[0], np.eye(3)[2], np.eye(3)[1])]
        )
        found, ambient = staging._lighting(rng, some, camera.centre_m)
        lit = np.sum(
            [[*light.centre_m, *light.half_u_m, *light.half_v_m, *light.power] for light in found], axis=0
        )
        sensor = staging._sensor(rng)
        rows.append(
            np.concatenate(
                [
                    [camera.width_px, camera.fx_px, camera.cx_px],
                    camera.T_world_camera.ravel(),
                    lit,
                    *astuple(ambient),
                    sensor.white_balance,
                    astuple(sensor)[1:],
                    np.ravel(staging._places(rng, 3)),
                ]
            )
        )
    who = [draw_identity(rng, HELD_OUT) for rng in rngs(8)]
    stands = [staging._person(identity, (0.1, 0.2), 0)[0].keypoints_m[[0, 9, 18]].ravel() for identity in who]
    return [np.array(rows), np.array(stands)]


def arms_placed() -> list[np.ndarray]:
    model = collision_model(BODY, SHAPE)
    placers = (
        arms.hanging,
        arms.swinging,
        arms.one_reaching,
        arms.both_reaching,
        arms.pointing,
        arms.crossed,
        arms.raised,
        arms.on_hips,
        arms.near_face,
        arms.in_lap,
        arms.of_any_kind,
    )
    found = []
    for place in placers:
        for rng in rngs(6):
            draft = arms.Draft(rng, BODY, model, 0.01)
            joints = arms.hanging_arm(draft, "left") | arms.hanging_arm(draft, "right")
            joints |= {
                f"{side}_hip_flexion": 1.4 if place is arms.in_lap else 0.1 for side in ("left", "right")
            }
            placed = place(draft, joints)
            found.append([(placed or {}).get(name, 0.0) for name in LIMITS_DEG])
    return [*np.array_split(np.array(found), len(placers))]


def postures() -> list[np.ndarray]:
    found = []
    for kind in poses.KINDS:
        drawn = [poses.sample_joints(rng, BODY, kind, SHAPE) for rng in rngs(6)]
        found.append(np.array([[joints.get(name, 0.0) for name in LIMITS_DEG] for joints in drawn]))
    return found


def rendered() -> list[np.ndarray]:
    """A person in a bare room, 64 x 48 pixels, and what a sensor makes of them."""
    appearance = people.appearance_of(Subject(8).identity)
    posed = pose_body(BODY, appearance.shape, {})
    lamp = lights.Light(
        np.array([1.5, 1, 2.4]), np.array([0.3, 0, 0]), np.array([0, 0.3, 0]), np.full(3, 5.0)
    )
    ambient = lights.Ambient(np.full(3, 0.4), np.full(3, 0.2), np.full(3, 0.1), np.array([1.0, 0, 0]))
    wall = Surface(quad([-1, -3, 0], [0, 6, 0], [0, 0, 3]), materials.paint(np.full(3, 0.6), 0.1))
    world = World([wall, *people.dress(appearance, posed, 0)], [lamp], ambient, np.zeros(3))
    camera = PlacedCamera(64, 48, 50.0, 50.0, 31.5, 23.5, look_at([2.2, 0.4, 1.3], [0, 0, 1.0]))
    frame = render(world, camera)
    sensor = Sensor(np.array([1.05, 1.0, 0.95]), saturation=0.9)
    image = expose(frame.radiance, sensor, np.random.default_rng(1), frame.person >= 0)
    return [frame.radiance.reshape(-1, 3), image.reshape(-1, 3), (frame.person >= 0).reshape(-1, 1)]


def experiments() -> list[np.ndarray]:
    rng = np.random.default_rng(6)
    table = laboratory.table(rng, (-0.6, 0.7), (0.6, 1.3), 0.72)
    chair = laboratory.chair(rng, (0.1, 1.2), 0.45)
    tubes, ambient = laboratory._lighting(rng, 2.5)
    robot = vertices(robot_surfaces(load_icub(), home_posture(load_icub())))
    lit = np.array([[*t.centre_m, *t.half_u_m, *t.half_v_m, *t.power] for t in tubes])
    return [vertices([table]), vertices(chair), lit, np.array(astuple(ambient)), robot]


def gestures_made() -> list[np.ndarray]:
    gestures = Gestures(np.random.default_rng(3), SHAPE)
    moves = [move for move, _ in zip(gestures.moves(), range(24), strict=False)]
    rows = [
        [move.duration_s, *move.to.place_m, *(move.to.joints.get(name, 0) for name in LIMITS_DEG)]
        for move in moves
    ]
    return [np.array(rows)]


def scripts_made() -> list[np.ndarray]:
    at_s = np.cumsum([0.0, *PHASES_S.values()])
    found = []
    for name in SCRIPTS:
        postures = [script(name).posture_at(t, np.array(HOME_M["left"])) for t in (*at_s, 2.6)]
        names = sorted(postures[0].joints | postures[3].joints)
        found.append(
            np.array([[*p.place_m, *(p.joints.get(joint, 0.0) for joint in names)] for p in postures])
        )
    return found


CASES: dict[str, Callable[[], list[np.ndarray]]] = {
    "textures": textures_seen,
    "hair styles": lambda: [styles_drawn()],
    "hair": hair_grown,
    "clothing": garments,
    "fabrics": cloths,
    "footwear": shoes,
    "materials": things,
    "skin": skins,
    "people": outfits,
    "room": rooms,
    "furniture": pieces,
    "staging": stages,
    "arms": arms_placed,
    "poses": postures,
    "render": rendered,
    "laboratory": experiments,
    "gestures": gestures_made,
    "scripts": scripts_made,
}


def computed(case: str) -> list[np.ndarray]:
    """Statistics of every array of a case."""
    return [statistics(values) for values in CASES[case]()]


if __name__ == "__main__":
    found = {
        case: [np.vectorize(lambda x: float(f"{x:.6g}"))(s).tolist() for s in computed(case)]
        for case in CASES
    }
    EXPECTED_FILE.write_text(json.dumps(found, separators=(",", ":")).replace('],"', '],\n"') + "\n")
