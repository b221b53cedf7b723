"""Splats: the reference against finite differences, the compiled rasteriser against the reference."""

from __future__ import annotations

from dataclasses import fields

import numba
import numpy as np
import pytest
import torch
from scenewright.schemas.errors import MissingDependency
from scenewright.schemas.scene_parts import Camera
from scenewright.stages.kit.rendering.splatting.compiled import CompiledRasterizer
from scenewright.stages.kit.rendering.splatting.gaussians import GaussianGradients, Gaussians
from scenewright.stages.kit.rendering.splatting.gpu import GpuRasterizer
from scenewright.stages.kit.rendering.splatting.harmonics import basis
from scenewright.stages.kit.rendering.splatting.rasterizer import Picture, View
from scenewright.stages.kit.rendering.splatting.reference import ReferenceRasterizer, moved
from scipy.spatial.transform import Rotation

SMALL = Camera(width=18, height=13, fx=14.0, fy=15.0, cx=8.3, cy=6.1)
ODD = Camera(width=50, height=37, fx=40.0, fy=41.0, cx=24.0, cy=19.0)


def scene(count: int, seed: int, *, scale: float, basis_count: int = 1, features: int = 2) -> Gaussians:
    """Gaussians in front of a camera at the origin that looks along z, some beside and some behind it."""
    random = np.random.default_rng(seed)
    means = np.stack(
        [random.uniform(-2.5, 2.5, count), random.uniform(-2, 2, count), random.uniform(-0.5, 5, count)], 1
    )
    return Gaussians(
        means,
        random.normal(size=(count, 4)),
        np.log(scale) + random.normal(0, 0.5, (count, 3)),
        random.normal(0.5, 2.0, count),
        random.normal(0, 0.3, (count, basis_count, 3)),
        random.normal(size=(count, features)),
    )


def view_of(camera: Camera) -> View:
    pose = np.eye(4)
    pose[:3, :3] = Rotation.from_rotvec([0.1, 0.2, -0.05]).as_matrix()
    pose[:3, 3] = [0.1, -0.05, 0.2]
    return View(camera, pose, (0.2, 0.5, 0.7))


def weights(camera: Camera, features: int, seed: int = 5) -> Picture:
    """A random derivative by every pixel of every channel: the loss is the sum of their products."""
    random, size = np.random.default_rng(seed), (camera.height, camera.width)
    return Picture(
        random.normal(size=(*size, 3)),
        random.normal(size=size),
        random.normal(size=size),
        random.normal(size=(*size, features)),
    )


def loss(picture: Picture, by: Picture) -> float:
    return sum(float((getattr(picture, f.name) * getattr(by, f.name)).sum()) for f in fields(Picture))


@pytest.mark.parametrize("name", ["means", "quaternions", "log_scales", "logit_opacities", "harmonics", "features"])
@pytest.mark.slow
def test_gradients_of_the_reference_are_finite_differences(name: str) -> None:
    gaussians, view, by = scene(14, 1, scale=0.35), view_of(SMALL), weights(SMALL, 2)
    analytic = getattr(ReferenceRasterizer().draw(gaussians, view).backward(by), name)
    step, numeric = 1e-6, np.zeros_like(analytic)
    array = getattr(gaussians, name)
    for index in np.ndindex(array.shape):
        sides = []
        for sign in (1, -1):
            kept = array[index]
            array[index] = kept + sign * step
            sides.append(loss(ReferenceRasterizer().draw(gaussians, view).picture, by))
            array[index] = kept
        numeric[index] = (sides[0] - sides[1]) / (2 * step)
    assert np.abs(numeric).max() > 0.1
    np.testing.assert_allclose(analytic, numeric, rtol=1e-4, atol=1e-5 * np.abs(numeric).max())


def test_the_gradient_by_the_camera_is_a_finite_difference() -> None:
    gaussians, view, by = scene(14, 1, scale=0.35), view_of(SMALL), weights(SMALL, 2)
    analytic = ReferenceRasterizer().draw(gaussians, view).backward(by).twist
    for axis in range(6):
        sides = []
        for sign in (1e-6, -1e-6):
            twist = torch.zeros(6, dtype=torch.float64)
            twist[axis] = sign
            pose = moved(view.camera_from_world, twist).numpy()
            sides.append(loss(ReferenceRasterizer().draw(gaussians, View(SMALL, pose, view.background)).picture, by))
        assert analytic[axis] == pytest.approx((sides[0] - sides[1]) / 2e-6, rel=1e-4)


@pytest.mark.parametrize(
    ("count", "scale", "basis_count", "features"), [(300, 0.1, 16, 3), (60, 0.6, 4, 0), (400, 0.01, 9, 7)]
)
def test_the_compiled_rasterizer_agrees_with_the_reference(
    count: int, scale: float, basis_count: int, features: int
) -> None:
    """The tolerance that docs/SPLATS.md states: pictures within 2e-5, gradients within 1e-4 of the greatest."""
    gaussians = scene(count, 3, scale=scale, basis_count=basis_count, features=features)
    single = Gaussians(**{name: array.astype(np.float32) for name, array in gaussians.arrays().items()})
    double = Gaussians(**{name: array.astype(np.float64) for name, array in single.arrays().items()})
    view, by = view_of(ODD), weights(ODD, features)
    ours, theirs = CompiledRasterizer().draw(single, view), ReferenceRasterizer().draw(double, view)
    assert 0 < ours.visible.sum() < count
    np.testing.assert_array_equal(ours.visible, theirs.visible)
    for field in fields(Picture):
        found, expected = getattr(ours.picture, field.name), getattr(theirs.picture, field.name)
        np.testing.assert_allclose(found, expected, atol=2e-5, rtol=0)
    back, expected_back = ours.backward(by), theirs.backward(by)
    for field in fields(GaussianGradients):
        found, expected = getattr(back, field.name), getattr(expected_back, field.name)
        assert found.shape == expected.shape
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-4 * max(np.abs(expected).max(initial=0), 1e-9))


@pytest.mark.skipif(not torch.cuda.is_available(), reason="gsplat draws with CUDA")
@pytest.mark.parametrize(
    ("count", "scale", "basis_count", "features"), [(300, 0.1, 16, 3), (60, 0.6, 4, 0), (400, 0.01, 9, 7)]
)
def test_gsplat_agrees_with_the_reference(count: int, scale: float, basis_count: int, features: int) -> None:
    """Pictures within 2e-4, gradients within 1e-3 of the greatest: gsplat computes with fast, inexact mathematics."""
    pytest.importorskip("gsplat")
    gaussians = scene(count, 3, scale=scale, basis_count=basis_count, features=features)
    single = Gaussians(**{name: array.astype(np.float32) for name, array in gaussians.arrays().items()})
    double = Gaussians(**{name: array.astype(np.float64) for name, array in single.arrays().items()})
    view, by = view_of(ODD), weights(ODD, features)
    ours, theirs = GpuRasterizer().draw(single, view), ReferenceRasterizer().draw(double, view)
    assert not (theirs.visible & ~ours.visible).any() and ours.visible.sum() < count
    for field in fields(Picture):
        found, expected = getattr(ours.picture, field.name), getattr(theirs.picture, field.name)
        np.testing.assert_allclose(found, expected, atol=2e-4, rtol=0)
    back, expected_back = ours.backward(by), theirs.backward(by)
    for field in fields(GaussianGradients):
        found, expected = getattr(back, field.name), getattr(expected_back, field.name)
        assert found.shape == expected.shape
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-3 * max(np.abs(expected).max(initial=0), 1e-9))


def test_opaque_gaussians_hide_what_is_behind_them() -> None:
    gaussians = scene(2, 0, scale=0.5)
    gaussians.means[:] = [[0, 0, 1.0], [0, 0, 2.0]]
    gaussians.logit_opacities[:] = 12.0
    gaussians.harmonics[:] = [[[1.0, -1.0, -1.0]], [[-1.0, 1.0, -1.0]]]
    drawn = CompiledRasterizer().draw(gaussians, View(ODD, np.eye(4)))
    middle = drawn.picture.color[19, 24]
    assert middle[0] > 0.7 and middle[1] < 0.22
    assert drawn.picture.depth[19, 24] == pytest.approx(1.0, abs=0.01)
    assert drawn.visible.all()


def test_the_number_of_threads_changes_no_bit() -> None:
    gaussians, view, by = scene(300, 4, scale=0.1, basis_count=4), view_of(ODD), weights(ODD, 2)
    results, before = [], numba.get_num_threads()
    for threads in {1, before}:
        numba.set_num_threads(threads)
        drawn = CompiledRasterizer().draw(gaussians, view)
        gradients = drawn.backward(by)
        results.append([drawn.picture.color, drawn.picture.depth, gradients.means, gradients.centers, gradients.twist])
    numba.set_num_threads(before)
    for found, expected in zip(results[0], results[-1], strict=True):
        np.testing.assert_array_equal(found, expected)


def test_no_gaussians_show_the_background() -> None:
    nothing = scene(3, 0, scale=0.1).taken(np.zeros(3, bool))
    on_gpu = [GpuRasterizer()] if torch.cuda.is_available() else []
    for rasterizer in (CompiledRasterizer(), ReferenceRasterizer(), *on_gpu):
        drawn = rasterizer.draw(nothing, view_of(SMALL))
        assert np.allclose(drawn.picture.color, (0.2, 0.5, 0.7)) and not drawn.picture.alpha.any()
        assert drawn.backward(weights(SMALL, 2)).twist.tolist() == [0.0] * 6


def test_harmonics_are_orthonormal() -> None:
    nodes, node_weights = np.polynomial.legendre.leggauss(12)
    angles = 2 * np.pi * np.arange(24) / 24
    z, phi = (grid.ravel() for grid in np.meshgrid(nodes, angles, indexing="ij"))
    side = np.sqrt(1 - z * z)
    values = basis(np.stack([side * np.cos(phi), side * np.sin(phi), z], axis=1), 16)
    area = np.repeat(node_weights, 24) * 2 * np.pi / 24
    np.testing.assert_allclose(values.T @ (values * area[:, None]), np.eye(16), atol=1e-12)


def test_arrays_that_do_not_belong_together_are_refused() -> None:
    arrays = scene(4, 0, scale=0.1).arrays()
    with pytest.raises(ValueError, match="log_scales has shape"):
        Gaussians(**{**arrays, "log_scales": np.zeros((3, 3))})
    with pytest.raises(ValueError, match="harmonics a colour"):
        Gaussians(**{**arrays, "harmonics": np.zeros((4, 5, 3))})


@pytest.mark.skipif(torch.cuda.is_available(), reason="there is CUDA")
def test_gsplat_says_what_it_lacks() -> None:
    with pytest.raises(MissingDependency, match="no CUDA device"):
        GpuRasterizer()
