import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from hicp_lib.simulation.rendering.camera import PlacedCamera, look_at, pixel_rays, project_world

CAMERA = PlacedCamera(
    64, 48, 60.0, 62.0, 31.5, 23.5, look_at([1.0, -3.0, 1.5], [0.2, 0.1, 1.0], roll_rad=0.1)
)


@given(u=st.floats(-0.49, 63.4), v=st.floats(-0.49, 47.4), depth=st.floats(0.3, 10))
def test_a_ray_at_a_depth_projects_back_to_its_pixel(u, v, depth):
    ray = pixel_rays(CAMERA, np.array([[u, v]]))[0].astype(float)
    pixel, z = project_world(CAMERA, ray[:3] + depth * ray[3:])
    assert np.allclose(pixel, [u, v], atol=1e-3)
    assert np.isclose(z, depth, atol=1e-4)
    assert CAMERA.contains(pixel)


def test_rays_of_the_whole_image_come_row_by_row():
    rays = pixel_rays(CAMERA)
    one = pixel_rays(CAMERA, np.array([[5, 7]]))[0]
    assert rays.shape == (64 * 48, 6)
    assert np.allclose(rays[7 * 64 + 5], one, atol=1e-6)


def test_look_at_puts_the_target_in_the_middle_and_up_upwards():
    camera = PlacedCamera(64, 48, 60.0, 60.0, 31.5, 23.5, look_at([0, -3, 1], [0, 0, 1]))
    pixel, depth = project_world(camera, np.array([[0.0, 0, 1], [0, 0, 1.5], [0.5, 0, 1]]))
    assert np.allclose(pixel[0], [31.5, 23.5]) and np.isclose(depth[0], 3)
    assert pixel[1, 1] < pixel[0, 1]  # higher in the world is higher in the image
    assert pixel[2, 0] > pixel[0, 0]
    assert project_world(camera, camera.centre_m)[1] == 0


def test_points_behind_the_camera_have_no_pixel():
    pixel, depth = project_world(CAMERA, CAMERA.centre_m - CAMERA.T_world_camera[:3, 2])
    assert np.isnan(pixel).all() and depth < 0 and not CAMERA.contains(pixel)
