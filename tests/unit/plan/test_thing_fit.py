"""How a thing lies and how large it is, by what two cameras saw of it."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from scenewright.stages.kit.geometry.transforms import apply, transform_from_yaw
from scenewright.stages.kit.simulation.shapes import link_shapes, surface_points
from scenewright.stages.plan.scaled_body import scaled_text
from scenewright.stages.plan.thing_fit import FittedThing, fit_thing, in_sight
from scipy.spatial.transform import Rotation

EYES = np.array([[0.0, -0.7, 0.8], [0.0, -0.15, 0.5]])


def mug() -> list[trimesh.Trimesh]:
    """A cylinder with a handle, foot at the origin."""
    body = trimesh.creation.cylinder(radius=0.035, height=0.09, sections=48)
    handle = trimesh.creation.box(extents=(0.03, 0.01, 0.05))
    body.apply_translation((0, 0, 0.045))
    handle.apply_translation((0.048, 0, 0.045))
    return [body, handle]


def looked_at(pose: np.ndarray, scale: float, believed: np.ndarray) -> tuple[FittedThing, np.ndarray]:
    """Return the fit of the mug to a noisy look at one that is `scale` times as large, and the true points."""
    random = np.random.default_rng(1)
    dense, out = surface_points(mug(), 6000, random)
    points = apply(pose, scale * dense)
    shown = np.any([in_sight(points, out @ pose[:3, :3].T, eye) for eye in EYES], axis=0)
    seen = points[shown] + random.normal(0, 0.0015, (int(shown.sum()), 3))
    return fit_thing(seen, EYES, surface_points(mug(), 3000, np.random.default_rng(0)), believed), points


@pytest.mark.parametrize(("yaw", "scale"), [(0.0, 1.0), (-2.5, 1.15), (-1.2, 0.88)])
def test_it_stands_where_it_was_seen_as_large_as_it_is(yaw: float, scale: float) -> None:
    truth = transform_from_yaw(yaw, np.array([0.02, 0.03, 0.0]))
    fit, points = looked_at(truth, scale, np.eye(4))
    assert fit.scale == pytest.approx(scale, abs=0.05)
    found = apply(fit.pose, fit.scale * surface_points(mug(), 6000, np.random.default_rng(1))[0])
    assert np.linalg.norm(found - points, axis=1).mean() < 0.006
    assert fit.pose[2, 2] == pytest.approx(1.0)


def test_what_fell_lies_on_its_side() -> None:
    truth = transform_from_yaw(0.4, np.array([0.01, 0.0, 0.035]))
    truth[:3, :3] = truth[:3, :3] @ Rotation.from_euler("y", 90, degrees=True).as_matrix()
    fit, points = looked_at(truth, 1.0, np.eye(4))
    assert abs(fit.pose[2, 2]) < 0.1
    found = apply(fit.pose, fit.scale * surface_points(mug(), 6000, np.random.default_rng(1))[0])
    assert np.abs(found.mean(axis=0) - points.mean(axis=0)).max() < 0.006


def test_a_body_in_another_size_has_all_lengths_so_much_longer() -> None:
    text = (
        '<robot name="a"><link name="a"><inertial><origin xyz="0 0 0.1"/><mass value="2"/></inertial><collision>'
        '<origin xyz="0.1 0 0.2" rpy="0 0 0.5"/><geometry><box size="0.2 0.4 0.1"/></geometry></collision><collision>'
        '<geometry><cylinder radius="0.1" length="0.3"/></geometry></collision></link></robot>'
    )
    before, after = (np.concatenate([m.vertices for m in link_shapes(t)["a"]]) for t in (text, scaled_text(text, 1.5)))
    assert after == pytest.approx(1.5 * before, abs=1e-7)
    assert 'mass value="2"' in scaled_text(text, 1.5)
