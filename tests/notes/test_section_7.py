"""Section 7 of the lecture notes, Viewing: from world to pixels by matrices."""

import numpy as np

from glint.engine import linear
from glint.engine.scene import Camera, viewing

EPS = np.finfo(np.float64).eps
EYE, GAZE, UP = np.array([4.0, 3.0, 5.0]), np.array([-4.0, -2.0, -5.0]), np.array([0.0, 1.0, 0.0])


def close(found, expected, ulps=32.0):
    np.testing.assert_allclose(
        found, expected, rtol=0, atol=ulps * EPS * max(1.0, np.max(np.abs(expected)))
    )


def test_7_2_each_space_leads_to_the_next():
    basis = linear.camera_basis(GAZE, UP)
    far_corner = EYE + basis @ [2.0, 1.0, -8.0]
    in_camera = linear.transform_points(linear.camera_from_world(EYE, GAZE, UP), far_corner)
    close(in_camera, [2.0, 1.0, -8.0])
    canonical = linear.transform_points(linear.orthographic(-2, 2, -1, 1, -2, -8), in_camera)
    close(canonical, [1.0, 1.0, -1.0])
    screen = linear.transform_points(linear.viewport(40, 20), canonical)
    close(screen, [39.5, 19.5, -1.0])


def test_7_3_viewport_matrix():
    nx, ny = 8, 6
    expected = [
        [nx / 2, 0, 0, (nx - 1) / 2],
        [0, ny / 2, 0, (ny - 1) / 2],
        [0, 0, 1, 0],
        [0, 0, 0, 1],
    ]
    np.testing.assert_array_equal(linear.viewport(nx, ny), expected)
    corners = linear.transform_points(linear.viewport(nx, ny), [[-1, -1, 0.25], [1, 1, 0.25]])
    np.testing.assert_array_equal(corners, [[-0.5, -0.5, 0.25], [7.5, 5.5, 0.25]])


def test_7_4_orthographic_matrix():
    l, r, b, t, n, f = -3.0, 5.0, -1.0, 2.0, -0.5, -8.0  # noqa: E741
    expected = [
        [2 / (r - l), 0, 0, -(r + l) / (r - l)],
        [0, 2 / (t - b), 0, -(t + b) / (t - b)],
        [0, 0, 2 / (n - f), -(n + f) / (n - f)],
        [0, 0, 0, 1],
    ]
    close(linear.orthographic(l, r, b, t, n, f), expected)
    close(
        linear.transform_points(linear.orthographic(l, r, b, t, n, f), [[l, b, f], [r, t, n]]),
        [[-1, -1, -1], [1, 1, 1]],
    )


def test_7_2_perspective_keeps_the_near_plane_and_shrinks_with_distance():
    n, f = -2.0, -10.0
    p = linear.perspective(n, f)
    close(linear.transform_points(p, [0.5, -0.25, n]), [0.5, -0.25, n])
    close(linear.transform_points(p, [5.0, -2.5, f]), [1.0, -0.5, f])
    depths = linear.transform_points(p, [[0, 0, z] for z in (-2.0, -3.0, -5.0, -10.0)])[:, 2]
    assert np.all(np.diff(depths) < 0)  # order along the ray is kept


def test_7_5_camera_basis_is_right_handed():
    u, v, w = linear.camera_basis(GAZE, UP).T
    close(w, -GAZE / np.sqrt(45.0))
    close(u, np.cross(UP, w) / np.linalg.norm(np.cross(UP, w)))
    close(v, np.cross(w, u))
    assert v @ UP > 0


def test_7_5_camera_matrix_is_the_rigid_inverse_of_the_frame():
    basis = linear.camera_basis(GAZE, UP)
    frame = np.eye(4)
    frame[:3, :3], frame[:3, 3] = basis, EYE
    close(linear.camera_from_world(EYE, GAZE, UP), np.linalg.inv(frame))
    close(linear.camera_from_world(EYE, GAZE, UP)[:3, :3], basis.T)
    close(linear.transform_points(linear.camera_from_world(EYE, GAZE, UP), EYE), np.zeros(3))


def placed(kind, window):
    frame = np.column_stack([linear.camera_basis(GAZE, UP), EYE])
    return Camera(kind, frame, window, (16, 12))


def test_7_5_the_chain_takes_a_point_to_its_pixel():
    camera = placed("ORTHOGRAPHIC", (-2.0, 2.0, -1.5, 1.5))
    chain = (
        linear.viewport(16, 12)
        @ linear.orthographic(-2, 2, -1.5, 1.5, -1, -2)
        @ linear.camera_from_world(EYE, GAZE, UP)
    )
    points = EYE + np.random.default_rng(12).normal(size=(50, 3))
    pixel = np.concatenate([points, np.ones((50, 1))], 1) @ chain.T
    close(pixel[:, 3], np.ones(50))
    close(viewing.pixel_from_world(camera), chain, 128)
    close(viewing.project_to_pixels(points, camera)[:, :2], pixel[:, :2], 128)


def test_7_1_every_point_of_a_pixels_viewing_ray_projects_to_that_pixel():
    # Section 4.6's rays, section 7's matrices: an oblique window in both kinds of view.
    l, r, b, t = window = (-0.5, 1.5, 0.25, 1.0)  # noqa: E741
    for kind in ("ORTHOGRAPHIC", "PERSPECTIVE"):
        camera = placed(kind, window)
        e, (u_axis, v_axis, w_axis) = EYE, camera.world_from_camera[:, :3].T
        for i, j in ((0, 0), (15, 11), (7, 3)):
            u, v = l + (i + 0.5) * (r - l) / 16, b + (j + 0.5) * (t - b) / 12
            offset = u * u_axis + v * v_axis
            origin, direction = (
                (e, offset - w_axis) if kind == "PERSPECTIVE" else (e + offset, -w_axis)
            )
            points = origin + np.array([[0.5], [3.0], [70.0]]) * direction
            close(
                viewing.project_to_pixels(points, camera),
                [[i, j, 0.5], [i, j, 3.0], [i, j, 70.0]],
                128,
            )
