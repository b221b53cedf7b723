"""Convex solids: volume, mass, inertia in closed form, convexity."""

from __future__ import annotations

import numpy as np
import pytest
from scenewright.stages.kit.geometry.solids import (
    Solid,
    bar,
    box,
    contains,
    cushion,
    cylinder,
    hull,
    mass_properties,
    shell,
    volume,
)


def is_convex(solid: Solid) -> bool:
    """Whether no vertex lies beyond any face, and faces look outwards."""
    corners = solid.vertices[solid.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
    height = np.einsum("fvi,fi->fv", solid.vertices[None] - corners[:, :1], normals)
    return bool(height.max() < 1e-9)


def test_box_inertia_is_the_closed_form():
    a, b, c, density = 0.4, 0.7, 1.1, 600.0
    found = mass_properties([box((1, 1 + a), (-2, -2 + b), (0.5, 0.5 + c))], [density])
    mass = density * a * b * c
    assert found.mass == pytest.approx(mass)
    assert found.center == pytest.approx([1 + a / 2, -2 + b / 2, 0.5 + c / 2])
    expected = mass / 12 * np.diag([b * b + c * c, a * a + c * c, a * a + b * b])
    assert np.abs(found.inertia - expected).max() < 1e-9 * mass


def test_cylinder_inertia_converges_to_the_closed_form():
    radius, height = 0.3, 0.8
    found = mass_properties([cylinder(radius, (0, height), (0.2, -0.1), count=720)], [1000.0])
    mass = 1000.0 * np.pi * radius**2 * height
    assert found.mass == pytest.approx(mass, rel=1e-4)
    assert found.center == pytest.approx([0.2, -0.1, 0.4], abs=1e-9)
    across = mass * (3 * radius**2 + height**2) / 12
    assert np.diag(found.inertia) == pytest.approx([across, across, mass * radius**2 / 2], rel=2e-4)


def test_parts_add_up_by_the_parallel_axis_theorem():
    one, two = box((0, 1), (0, 1), (0, 1)), box((3, 4), (0, 1), (0, 1))
    found = mass_properties([one, two], [2.0, 2.0])
    each = 2.0 / 6
    assert found.center == pytest.approx([2, 0.5, 0.5])
    assert np.diag(found.inertia) == pytest.approx([2 * each, 2 * (each + 2.0 * 1.5**2), 2 * (each + 2.0 * 1.5**2)])


def test_hollow_cylinder_mass_is_the_difference_of_two():
    inner, outer, height = 0.05, 0.06, 0.1
    wedges = shell([(inner, 0), (inner, height)], [(outer, 0), (outer, height)], count=180)
    expected = np.pi * (outer**2 - inner**2) * height
    assert sum(volume(wedge) for wedge in wedges) == pytest.approx(expected, rel=0.01)
    assert not any(contains(wedge, np.array([[0, 0, 0.05]]))[0] for wedge in wedges)
    middle = np.array([[0.055 * np.cos(0.3), 0.055 * np.sin(0.3), 0.05]])
    assert any(contains(wedge, middle)[0] for wedge in wedges)


@pytest.mark.parametrize("scale", [0.5, 1.0, 1.7])
def test_scaling_rules_agree_with_the_scaled_solid(scale):
    solid = cushion((0, 0.5), (0, 0.7), (0, 0.2), 0.03)
    bigger = Solid(solid.vertices * scale, solid.faces, solid.curved)
    direct, by_rule = mass_properties([bigger], [300.0]), mass_properties([solid], [300.0]).scaled(scale)
    assert by_rule.mass == pytest.approx(direct.mass)
    assert by_rule.center == pytest.approx(direct.center)
    assert by_rule.inertia == pytest.approx(direct.inertia, abs=1e-12)


def test_primitives_are_convex_and_closed():
    solids = [
        box((0, 1), (0, 2), (0, 3)),
        cylinder(0.2, (0, 1), top_radius=0.1),
        bar(np.zeros(3), np.array([1.0, 2.0, -1.0]), 0.1),
        cushion((0, 1), (0, 1), (0, 0.3), 0.05),
        hull(np.random.default_rng(0).normal(size=(40, 3))),
        *shell([(0.3, 0), (0.4, 0.5)], [(0.35, 0), (0.45, 0.5)]),
    ]
    for solid in solids:
        assert is_convex(solid)
        edges = np.sort(solid.faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
        _, counts = np.unique(edges, axis=0, return_counts=True)
        assert (counts == 2).all()
        assert volume(solid) > 0


def test_an_empty_box_is_refused():
    with pytest.raises(ValueError, match="empty"):
        box((0, 1), (1, 1), (0, 1))
    with pytest.raises(ValueError, match="volume"):
        mass_properties([], [])
