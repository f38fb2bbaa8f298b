import numpy as np

from hicp_lib.simulation.rendering import mesh as g


def _area(vertices, triangles):
    a, b, c = (vertices[triangles[:, i]] for i in range(3))
    return np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2


def test_a_cut_keeps_exactly_the_part_where_the_field_is_positive():
    n = 9
    x, y = np.meshgrid(np.arange(n), np.arange(n), indexing="ij")
    vertices = np.stack([x.ravel(), y.ravel(), 0 * x.ravel()], axis=1).astype(float)
    cut = g.cut(g.grid_triangles(n, n), 3.3 - vertices[:, 0])
    part = cut.apply(vertices)
    assert np.isclose(_area(part, cut.triangles), 3.3 * 8)
    assert part[:, 0].max() <= 3.3 + 1e-6
    assert (vertices[:, 0][g.grid_triangles(n, n)[cut.source]].min(axis=1) < 3.3).all()


def test_a_cut_follows_its_mesh_into_another_pose():
    vertices = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
    cut = g.cut(np.array([[0, 1, 2]]), np.array([1.0, -1.0, -3.0]))
    moved = vertices @ np.array([[0, -1, 0], [1, 0, 0], [0, 0, 2.0]]) + 5
    assert np.allclose(
        cut.apply(moved), cut.apply(vertices) @ np.array([[0, -1, 0], [1, 0, 0], [0, 0, 2.0]]) + 5
    )


def test_boxes_are_closed_and_face_outwards():
    mesh = g.box([0, 0, 0], [1, 2, 3], yaw_rad=0.4)
    assert np.isclose(_area(mesh.vertices_m, mesh.triangles), 2 * (2 + 3 + 6), atol=1e-4)
    a, b, c = (mesh.vertices_m[mesh.triangles[:, i]] for i in range(3))
    face = g.unit(np.cross(b - a, c - a))
    centre = np.array([0.5, 1, 1.5])
    assert (np.einsum("ij,ij->i", face, (a + b + c) / 3 - centre) > 0).all()
    assert np.allclose(np.einsum("ij,ij->i", face, mesh.normals[mesh.triangles[:, 0]]), 1, atol=1e-5)


def test_boundary_and_smoothing_of_a_grid():
    triangles = g.grid_triangles(4, 5)
    assert len(g.boundary_edges(triangles)) == 2 * (3 + 4)
    step = g.smoothing(triangles, 20).toarray()
    assert np.allclose(step.sum(axis=1), 1) and np.allclose(np.diag(step), 0.4)
    on_edge, within = ({k: round(step[row, k], 6) for k in np.flatnonzero(step[row])} for row in (2, 6))
    assert on_edge == {1: 0.3, 2: 0.4, 3: 0.3}  # along the boundary only
    assert within == {0: 0.1, 1: 0.1, 5: 0.1, 6: 0.4, 7: 0.1, 11: 0.1, 12: 0.1}
