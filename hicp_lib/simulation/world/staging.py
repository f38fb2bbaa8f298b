"""Staging: positions of people, room and light, and the camera's viewpoint."""

from dataclasses import dataclass, replace
from itertools import chain

import numpy as np

from hicp_lib.core.keypoints import INDEX
from hicp_lib.core.rotations import about
from hicp_lib.simulation.appearance.materials import hsv
from hicp_lib.simulation.appearance.people import appearance_of, dress
from hicp_lib.simulation.body.identities import HELD_OUT, PEOPLE, Identity, Rng, draw_identity
from hicp_lib.simulation.body.model import PosedBody, load_body, pose_body
from hicp_lib.simulation.body.poses import sample_pose
from hicp_lib.simulation.rendering import lights
from hicp_lib.simulation.rendering.camera import PlacedCamera, look_at
from hicp_lib.simulation.rendering.colour_sensor import Sensor
from hicp_lib.simulation.rendering.render import World
from hicp_lib.simulation.rendering.surfaces import Surface
from hicp_lib.simulation.world.furniture import stool
from hicp_lib.simulation.world.room import Room, make_room


@dataclass(frozen=True)
class Stage:
    """A scene ready to be photographed.

    Attributes
    ----------
    world : World
    camera : PlacedCamera
    sensor : Sensor
    people : list of PosedBody
        In the order of the surfaces' person numbers.
    identities : list of Identity
        Their identities; room, lights and camera are those of the first.
    """

    world: World
    camera: PlacedCamera
    sensor: Sensor
    people: list[PosedBody]
    identities: list[Identity]


def random_stage(rng: Rng, split: str = HELD_OUT) -> Stage:
    """One to three people, one to five metres from a camera, in a furnished room.

    Parameters
    ----------
    rng : numpy.random.Generator
        For sampling the identities; everything else follows from their seeds.
    split : str, optional
        Of the identities.

    Returns
    -------
    Stage

    Examples
    --------
    >>> stage = random_stage(np.random.default_rng(0))
    >>> len(stage.people), (stage.camera.width_px, stage.camera.height_px)
    (3, (640, 480))
    """
    first = draw_identity(rng, split)
    taken = first.draw("camera")
    places = _places(taken, int(taken.choice([1, 2, 3], p=[0.68, 0.24, 0.08])))
    everyone = [first]
    for one in [draw_identity(rng, split) for _ in places[1:]]:
        everyone.append(replace(one, room=first.room, lights=first.lights, camera=first.camera))
    people, dressed = zip(*map(_person, everyone, places, range(len(places))), strict=True)
    camera = _camera(taken, people[0])
    centre = camera.centre_m
    clear = [(x, y, 0.55) for x, y in places] + [(centre[0], centre[1], 0.7)]
    if taken.random() < 0.88:  # otherwise something may stand in front of people
        ways = (np.array(place) - centre[:2] for place in places)
        clear += [(*(centre[:2] + t * way), 0.3) for way in ways for t in (0.3, 0.5, 0.7)]
    room = make_room(first.draw("room"), np.array(clear))
    surfaces = [*room.surfaces, *chain(*dressed)]
    world = World(surfaces, *_lighting(first.draw("lights"), room, centre), backdrop=np.zeros(3))
    return Stage(world, camera, _sensor(taken), list(people), everyone)


def _places(rng: Rng, n_people: int) -> list[tuple[float, float]]:
    """Spots on the floor; the camera looks along y from the origin's negative side."""
    places = [(rng.normal(0, 0.1), 0.0)]
    while len(places) < n_people:
        side, far = rng.uniform(0.6, 1.0) * rng.choice([-1, 1]), rng.uniform(-0.5, 1.2)
        spot = (places[0][0] + side, far)
        if all(np.hypot(spot[0] - x, spot[1] - y) > 0.6 for x, y in places):
            places.append(spot)
    return places


def _person(identity: Identity, place: tuple[float, float], number: int) -> tuple[PosedBody, list[Surface]]:
    appearance, rng = appearance_of(identity), identity.draw("poses")
    # Mostly towards the camera (which lies along -y), less often sideways, sometimes away.
    turns = [rng.normal(0, 0.45), rng.uniform(-1.8, 1.8), rng.uniform(-np.pi, np.pi)]
    yaw = -np.pi / 2 + rng.choice(turns, p=[0.76, 0.17, 0.07])
    T_world_body = np.eye(4)
    T_world_body[:3, :3] = about(2, yaw)
    T_world_body[:2, 3] = place
    kind = str(rng.choice(list(PEOPLE["photographed"]), p=list(PEOPLE["photographed"].values())))
    if kind == "sitting" and appearance.skirt is not None:  # a skirt would have to drape over the seat
        kind = "standing"
    body = load_body()
    posed = pose_body(body, appearance.shape, sample_pose(rng, body, kind, appearance.shape), T_world_body)
    return posed, dress(appearance, posed, number) + ([stool(rng, posed)] if kind == "sitting" else [])


def _camera(rng: Rng, person: PosedBody) -> PlacedCamera:
    """A hand-held camera that frames the first person: all of them, to the knees, or closer."""
    width, height = (480, 640) if rng.random() < 0.35 else (640, 480)
    focal = rng.uniform(0.82, 1.15) * 640
    (x, y, hips), chest = person.keypoints_m[INDEX["mid_hip"]], person.keypoints_m[INDEX["neck"], 2] - 0.2
    lowest = {"full": -0.05, "knees": 0.5 * hips, "hips": hips - 0.1, "close": chest - 0.05}
    bottom = lowest[rng.choice(list(lowest), p=[0.3, 0.28, 0.27, 0.15])] + rng.normal(0, 0.05)
    ceiling = person.vertices_m[:, 2].max() + rng.uniform(0.03, 0.35)
    distance = float(np.clip((ceiling - bottom) * focal / height * rng.uniform(1.0, 1.25), 0.95, 5.0))
    middle = np.array([x, y, (ceiling + bottom) / 2])
    eye_height, azimuth = np.clip(rng.normal(1.45, 0.22), 0.8, 2.0), rng.normal(0, 0.25)
    eye = middle + distance * np.array([np.sin(azimuth), -np.cos(azimuth), 0])
    eye[2] = eye_height
    target = middle + np.array([rng.normal(0, 0.10) * distance * width / focal, 0, 0])
    pose = look_at(eye, target, roll_rad=rng.normal(0, 0.02))
    return PlacedCamera(width, height, focal, focal, (width - 1) / 2, (height - 1) / 2, pose)


def _lighting(rng: Rng, room: Room, eye: np.ndarray) -> tuple[list[lights.Light], lights.Ambient]:
    """A key light (window, lamp or ceiling), mostly a second one, over soft light from all around."""
    daylight, lamp = _temperature(rng.uniform(0, 1)), _temperature(rng.uniform(-1.2, -0.2))
    found = []
    if room.windows and rng.random() < 0.7:
        centre, u, v, inward = room.windows[rng.integers(len(room.windows))]
        area = 4 * np.linalg.norm(u) * np.linalg.norm(v)
        found.append(lights.Light(centre + 0.05 * inward, u, v, daylight * area * rng.uniform(4, 9), inward))
    height = room.height_m - 0.12
    if not found or rng.random() < 0.6:
        spot = rng.uniform(-1.2, 1.2, 2) + np.array([0, -0.6])
        half_u, half_v, _ = rng.uniform(0.2, 0.6) * np.eye(3)
        found.append(lights.Light(np.array([*spot, height]), half_u, half_v, lamp * rng.uniform(3, 6)))
    if len(found) < 2 and rng.random() < 0.6:  # light from where the photographer stands
        spot = np.array([eye[0] + rng.uniform(-1.5, 1.5), eye[1], rng.uniform(1.6, 2.2)])
        centre = np.clip(spot, [*(-room.half_m), 0], [*room.half_m, 3])
        half_u, _, half_v = 0.35 * np.eye(3)
        found.append(lights.Light(centre, half_u, half_v, daylight * rng.uniform(0.8, 2.5)))
    base = daylight * rng.uniform(0.18, 0.42)
    side = np.array([rng.normal(), rng.normal() - 1, 0.2])
    down = base * rng.uniform(0.35, 0.65)
    return found, lights.Ambient(base, down, base, side / np.linalg.norm(side))


def _temperature(warm_to_cool: float) -> np.ndarray:
    """Linear RGB of light from incandescent (-1.2) over neutral (0) to the blue sky (1)."""
    colour = np.array([1 - 0.10 * warm_to_cool, 1.0, 1 + 0.16 * warm_to_cool])
    return colour ** (1.5 if warm_to_cool < 0 else 1)


def _sensor(rng: Rng) -> Sensor:
    tint = hsv(rng.random(), rng.uniform(0, 0.08), 1.0)
    exposure = float(np.exp(rng.normal(0.05, 0.18)))
    others = {name: rng.uniform(*limits) for name, limits in PEOPLE["camera"].items()}
    return Sensor(tint / tint.mean(), exposure, **others)
