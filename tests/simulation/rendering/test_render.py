"""Rendering against geometry that can be worked out by hand."""

import subprocess
import sys

import numpy as np
import pytest

from hicp_lib.core.keypoints import INDEX
from hicp_lib.simulation.appearance import materials
from hicp_lib.simulation.appearance.people import part_of_vertices
from hicp_lib.simulation.body.model import load_body, pose_body
from hicp_lib.simulation.rendering import lights
from hicp_lib.simulation.rendering import mesh as g
from hicp_lib.simulation.rendering.camera import PlacedCamera, image_directions, look_at
from hicp_lib.simulation.rendering.gbuffer import GBuffer, View, from_half
from hicp_lib.simulation.rendering.raycast import RayScene, trace_image
from hicp_lib.simulation.rendering.render import World, render
from hicp_lib.simulation.rendering.shadows import visibility
from hicp_lib.simulation.rendering.surfaces import Surface
from hicp_lib.simulation.world.visibility import keypoint_visibility

GREY = materials.plain(np.full(3, 0.5))
CAMERA = PlacedCamera(80, 60, 70.0, 70.0, 39.5, 29.5, look_at([0, -3, 1], [0, 0, 1]))


def _sphere(centre, radius):
    angle = np.linspace(-np.pi / 2, np.pi / 2, 65)
    return g.lathe(np.c_[radius * np.cos(angle), radius * np.sin(angle)], centre, 128)


def _world(surfaces):
    lamp = lights.Light(np.array([1.0, -2, 3]), np.array([0.2, 0, 0]), np.array([0, 0.2, 0]), np.full(3, 5.0))
    ambient = lights.Ambient(np.full(3, 0.4), np.full(3, 0.2), np.zeros(3), np.array([1.0, 0, 0]))
    return World(surfaces, [lamp], ambient, np.full(3, 0.25))


def test_depth_is_that_of_the_plane_and_the_sphere():
    wall = Surface(g.quad([-5, 2, -5], [10, 0, 0], [0, 0, 10]), GREY)
    ball = Surface(_sphere([0, 0, 1], 0.5), GREY, person=0)
    frame = render(_world([wall, ball]), CAMERA)
    v, u = np.mgrid[:60, :80]
    x, y = (u - 39.5) / 70, (v - 29.5) / 70
    a, b = x * x + y * y + 1, 3.0  # |t (x, y, 1) - (0, 0, 3)| = 0.5
    root = b * b - a * (9 - 0.25)
    expected = np.where(root > 0, (b - np.sqrt(np.maximum(root, 0))) / a, 5.0)
    inside, outside = root > 0.02, root < -0.02  # away from the silhouette
    assert np.abs(frame.depth_m - expected)[inside].max() < 2e-3
    assert np.abs(frame.depth_m - expected)[outside].max() < 1e-4
    assert (frame.person[inside] == 0).all() and (frame.person[outside] == -1).all()


def test_a_tilted_plane_has_exact_depth_where_nothing_was_traced():
    floor = Surface(g.quad([-9, -9, 0], [18, 0, 0], [0, 18, 0]), GREY)
    frame = render(_world([floor]), CAMERA)
    rows = np.arange(36, 60)
    expected = 70 / (rows - 29.5)  # one metre below the camera
    assert np.abs(frame.depth_m[rows] - expected[:, None]).max() < 1e-4
    assert np.isinf(frame.depth_m[:28]).all()
    assert np.allclose(frame.radiance[5], 0.25, atol=0.02)  # the backdrop


def test_shadows_are_dark_and_light_is_not_below_zero():
    floor = Surface(g.quad([-5, -5, 0], [10, 0, 0], [0, 10, 0]), GREY, person=0)
    roof = Surface(g.box([-0.6, -0.9, 1.2], [0.6, 0.6, 1.25]), GREY)
    camera = PlacedCamera(80, 60, 60.0, 60.0, 39.5, 29.5, look_at([0, -3, 1.0], [0, 0, 0]))
    lamp = lights.Light(
        np.array([0.0, -0.1, 3]), np.array([0.1, 0, 0]), np.array([0, 0.1, 0]), np.full(3, 9.0)
    )
    world = World([floor, roof], [lamp], _world([]).ambient, np.zeros(3))
    image = render(world, camera).radiance[..., 1]
    lit = render(World([floor], [lamp], world.ambient, np.zeros(3)), camera).radiance[..., 1]
    assert image.min() >= 0
    assert image[30, 40] < 0.5 * lit[30, 40]
    assert image[55, 5] == pytest.approx(lit[55, 5], rel=0.1)


def test_frames_of_one_world_are_those_of_worlds_made_anew():
    ball = Surface(_sphere([0, 0, 1], 0.5), GREY, person=0)
    kept = _world([ball])
    for eye in ([0, -3, 1], [1, -3, 1.5]):
        camera = PlacedCamera(80, 60, 70.0, 70.0, 39.5, 29.5, look_at(eye, [0, 0, 1]))
        again = render(kept, camera)
        fresh = render(_world([ball]), camera)
        assert (again.radiance == fresh.radiance).all() and (again.depth_m == fresh.depth_m).all()
        assert again.rays is kept.rays


def test_a_ball_alone_is_in_nobodys_shadow():
    """What turns away from the lamp is dark by its angle; it is no shadow that would spread to its edge."""
    lamp = lights.Light(np.array([3.0, -3, 1]), np.array([0.1, 0, 0]), np.array([0, 0, 0.1]), np.ones(3))
    scene = RayScene([Surface(_sphere([0, 0, 1], 0.5), GREY, person=0)])
    directions = image_directions(CAMERA)
    trace, _ = trace_image(scene, CAMERA.centre_m, directions, np.array([True]))
    view = View(trace, CAMERA.centre_m.astype(np.float32), directions)
    ball = GBuffer(view, np.ones((60, 80), bool))
    seen = visibility([lamp], scene, [ball], [ball.normals(scene)])
    assert seen.shape == (2, 60 * 80) and len(ball.pixels) > 400
    assert (seen == 1).all()


def test_values_of_every_second_pixel_stay_within_their_surface():
    board = Surface(g.quad([-0.3, 0, 0.6], [0.6, 0, 0.1], [0, 0, 0.8]), GREY, person=0)
    wall = Surface(g.quad([-5, 2, -5], [10, 0, 0], [0, 0, 10]), GREY)
    scene, directions = RayScene([board, wall]), image_directions(CAMERA)
    full, coarse = trace_image(scene, CAMERA.centre_m, directions, np.array([True, False]))
    view, half = (
        View(trace, CAMERA.centre_m, rays)
        for trace, rays in ((full, directions), (coarse, directions[:, ::2, ::2]))
    )
    pixels = GBuffer(view, np.ones((60, 80), bool))
    row, column = np.mgrid[:30, :40]
    values = np.stack([coarse.surface, 2 * (row + column).ravel()]).astype(np.float32)
    surface, place = from_half(values, half, view, pixels.pixels)
    assert np.abs(surface - full.surface[pixels.pixels]).max() < 1e-3
    shown = full.surface.reshape(60, 80)[:58, :78]
    around = [np.roll(shown, (dv, du), (0, 1)) for dv in (-1, 0, 1) for du in (-1, 0, 1)]
    inner = np.zeros((60, 80), bool)
    inner[1:57, 1:77] = (np.ptp(around, axis=0) == 0)[1:57, 1:77]
    expected = np.add(*np.divmod(pixels.pixels, 80))
    assert inner.sum() > 3000 and np.abs(place - expected)[inner.ravel()[pixels.pixels]].max() < 0.05


@pytest.fixture(scope="module")
def person():
    body = load_body()
    posed = pose_body(body, 0, {})  # at attention, facing +x
    part = part_of_vertices(body)[body.triangles[:, 0]]
    mesh = g.Mesh(
        posed.vertices_m, body.triangles, posed.normals, np.zeros((len(posed.vertices_m), 1), np.float32)
    )
    return posed, Surface(mesh, GREY, 0, part)


def _seen(person, surfaces, eye, target=(0, 0, 0.9)):
    camera = PlacedCamera(480, 640, 600.0, 600.0, 239.5, 319.5, look_at(eye, target))
    scene = RayScene([person[1], *surfaces])
    pixels, seen = keypoint_visibility(scene, camera, person[0].keypoints_m, 0)
    return pixels, {name: int(seen[index]) for name, index in INDEX.items()}


def test_from_the_front_joints_are_seen_through_their_own_flesh(person):
    _, seen = _seen(person, [], [3.0, 0, 1.2])
    names = "nose left_eye right_eye left_shoulder right_shoulder left_elbow right_wrist left_hip right_knee"
    assert [seen[name] for name in names.split()] == [2] * 9


def test_in_profile_the_far_side_is_occluded(person):
    _, seen = _seen(person, [], [0, 3.0, 1.2])  # from the person's left
    assert seen["left_eye"] == 2 and seen["right_eye"] == 1
    assert seen["left_ear"] == 2 and seen["right_ear"] == 1
    assert seen["left_wrist"] == 2 and seen["right_wrist"] == 1
    assert seen["left_shoulder"] == 2 and seen["right_shoulder"] == 1


def test_from_behind_the_face_is_occluded(person):
    _, seen = _seen(person, [], [-3.0, 0, 1.2])
    assert {seen[n] for n in ("nose", "left_eye", "right_eye", "face_30", "face_57")} == {1}
    assert seen["left_shoulder"] == seen["right_heel"] == 2


def test_a_board_in_front_occludes_what_lies_behind_it(person):
    board = Surface(g.box([1.0, -1, 0.0], [1.02, 1, 1.15]), GREY)
    _, seen = _seen(person, [board], [3.0, 0, 1.2])
    assert seen["nose"] == 2 and seen["left_knee"] == seen["right_hip"] == 1


def test_what_is_outside_the_image_is_outside(person):
    pixels, seen = _seen(person, [], [1.0, 0, 1.5], (0, 0, 1.5))
    assert seen["left_ankle"] == 0 and pixels[INDEX["left_ankle"], 1] > 639.5


def test_the_renderer_starts_without_dash_which_stays_whole_for_others():
    code = (
        "import sys, hicp_lib.simulation.rendering.raycast\n"
        "assert not [name for name in sys.modules if name.split('.')[0] == 'dash']\n"
        "import dash\n"
        "assert callable(dash.Dash)"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
