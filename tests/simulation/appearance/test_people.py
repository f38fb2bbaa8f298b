"""Dressed people: surfaces are seen from outside, tops stay inside skirts, hair outside the head."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import KDTree

from hicp_lib.core.keypoints import INDEX
from hicp_lib.simulation.appearance.people import Appearance, appearance_of, dress
from hicp_lib.simulation.body.identities import draw_identity, stream
from hicp_lib.simulation.body.model import PosedBody, load_body, pose_body
from hicp_lib.simulation.rendering.mesh import unit, vertex_normals
from hicp_lib.simulation.rendering.surfaces import Surface

Dressed = tuple[Appearance, PosedBody, list[Surface]]


@pytest.fixture(scope="module")
def everyone() -> list[Dressed]:
    """A dozen development people, arms held away."""
    found = []
    for number in range(12):
        appearance = appearance_of(draw_identity(stream("dressed", number), "development"))
        arms = {"upperarm01.L": np.array([0.4, 0, 0]), "upperarm01.R": np.array([-0.4, 0, 0])}
        posed = pose_body(load_body(), appearance.shape, arms)
        found.append((appearance, posed, dress(appearance, posed, 0)))
    return found


def test_normals_are_on_the_side_that_triangles_face(everyone):
    for _, _, surfaces in everyone:
        for surface in surfaces:
            mesh = surface.mesh
            a, b, c = mesh.vertices_m[mesh.triangles].swapaxes(0, 1)
            faces = unit(np.cross(b - a, c - a))
            agree = np.einsum("ij,ikj->ik", faces, mesh.normals[mesh.triangles]) > 0
            assert agree.mean() > 0.9


def test_a_top_stays_inside_the_skirt(everyone):
    dressed = [one for one in everyone if one[0].skirt is not None]
    assert dressed
    for appearance, posed, surfaces in dressed:
        top = surfaces[len(appearance.worn)].mesh.vertices_m
        *_, skirt = (s.mesh.vertices_m for s in surfaces if s.mesh.coords.shape[1] == 7)
        R, hips = posed.rotations[load_body().bone_numbers["root"]], posed.keypoints_m[INDEX["mid_hip"]]
        (x, y, z), (u, v, w) = (((vertices - hips) @ R).T for vertices in (top, skirt))
        low = z < w.max() - 0.02
        assert low.any()
        around = KDTree(np.column_stack([np.cos(np.arctan2(v, u)), np.sin(np.arctan2(v, u)), 3 * w]))
        angle = np.arctan2(y[low], x[low])
        _, near = around.query(np.column_stack([np.cos(angle), np.sin(angle), 3 * z[low]]))
        assert (np.hypot(x[low], y[low]) < np.hypot(u, v)[near]).all()


def test_hair_grows_from_the_head_and_stays_out_of_it(everyone):
    body = load_body()
    scalp = body.in_regions("scalp")
    with_hair = [one for one in everyone if one[0].style is not None]
    assert len(with_hair) > 6
    for _, posed, surfaces in with_hair:
        mesh = surfaces[-1].mesh
        normals = vertex_normals(posed.vertices_m, body.triangles)[scalp]
        distance, near = KDTree(posed.vertices_m[scalp]).query(mesh.vertices_m)
        height = np.einsum("ij,ij->i", mesh.vertices_m - posed.vertices_m[scalp][near], normals[near])
        assert (distance[mesh.coords[:, 3] == 0] < 0.05).mean() > 0.95
        assert (height[distance < 0.03] > -0.01).mean() > 0.97


def test_the_same_person_has_the_same_hair():
    appearance = appearance_of(draw_identity(stream("dressed", 1), "development"))
    posed = pose_body(load_body(), appearance.shape, {})
    first, second = (dress(replace(appearance), posed, 0)[-1].mesh.vertices_m for _ in range(2))
    assert np.array_equal(first, second)
