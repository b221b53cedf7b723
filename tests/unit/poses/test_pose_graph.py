"""Pose graphs against closed forms: a line that closes, a loop with known drift, wrong loops, parts."""

from __future__ import annotations

import numpy as np
import pytest
from scenewright.stages.kit.geometry.transforms import inverse
from scenewright.stages.kit.registration.pose_graph import Edge, laid_out, optimize, optimize_gradually, parts_of
from scenewright.stages.kit.registration.rigid_motion import angle_of, between, distance_of, exponential

SURE = np.eye(6) * 1e4


def step(x: float) -> np.ndarray:
    return exponential(np.array([0.0, 0.0, 0.0, x, 0.0, 0.0]))


def ring(count: int) -> np.ndarray:
    """Poses on a circle of 2 m that look along it."""
    poses = []
    for angle in 2 * np.pi * np.arange(count) / count:
        turn = exponential(np.array([0.0, 0.0, angle, 0.0, 0.0, 0.0]))
        poses.append(turn @ step(2.0))
    return np.array(poses)


def test_errors_of_a_line_are_shared_by_variance() -> None:
    """Three steps of 1 m of which the second is the least sure, and a loop that says 3.3 m: weighted least squares."""
    sureness = [100.0, 25.0, 100.0]
    edges = [Edge(k, k + 1, step(1.0), np.eye(6) * sureness[k]) for k in range(3)]
    edges.append(Edge(0, 3, step(3.3), np.eye(6) * 50.0, switchable=True))
    found = optimize(np.array([step(k) for k in range(4)]), edges)
    variances = np.array([*(1 / s for s in sureness), 1 / 50.0])
    corrections = 0.3 * variances / variances.sum()
    steps = np.diff(found.world_from_node[:, 0, 3])
    np.testing.assert_allclose(steps, 1 + corrections[:3], atol=1e-6)
    # Variance of the end: that of the chain (0.06) and of the loop (0.02) together.
    assert found.covariances[3][3, 3] == pytest.approx(1 / (1 / 0.06 + 50.0), rel=1e-3)


def test_a_ring_with_known_drift_closes() -> None:
    true = ring(24)
    drift = exponential(np.array([0.001, -0.002, 0.004, 0.01, 0.004, -0.006]))
    edges = [Edge(k, k + 1, between(true[k], true[k + 1]) @ drift, SURE) for k in range(23)]
    drifted = [true[0]]
    for edge in edges:
        drifted.append(drifted[-1] @ edge.target_from_source)
    before = distance_of(between(true[23], drifted[23]))
    edges.append(Edge(23, 0, between(true[23], true[0]), SURE * 1e4, switchable=True))
    found = optimize(np.array(drifted), edges, switch=1e9)
    after = [distance_of(between(a, b)) for a, b in zip(true, found.world_from_node, strict=True)]
    assert before > 0.25 and max(after) < 0.35 * before
    closing = between(found.world_from_node[23], found.world_from_node[0])
    assert distance_of(between(closing, between(true[23], true[0]))) < 1e-3
    assert np.array_equal(found.world_from_node[0], true[0]) or np.allclose(
        found.world_from_node[0], true[0], atol=1e-9
    )


def test_a_ring_that_drifted_far_closes_and_denies_wrong_loops() -> None:
    """Half a metre of drift is nothing that a loop of 3 mm would believe; wrong loops contradict each other as well."""
    true, wrong = ring(24), exponential(np.array([0.3, 0.0, 0.5, 1.0, -0.8, 0.4]))
    drift = exponential(np.array([0.0, 0.0, 0.012, 0.02, 0.0, 0.0]))
    edges = [Edge(k, k + 1, between(true[k], true[k + 1]) @ drift, SURE) for k in range(23)]
    drifted = [true[0]]
    for edge in edges:
        drifted.append(drifted[-1] @ edge.target_from_source)
    pairs = [(0, 23), (1, 22), (0, 22), (3, 15), (6, 18)]
    edges += [
        Edge(a, b, between(true[a], true[b]) @ (wrong if b < 20 else np.eye(4)), SURE * 10, switchable=True)
        for a, b in pairs
    ]
    far = [distance_of(between(a, b)) for a, b in zip(true, drifted, strict=True)]
    found = optimize_gradually(np.array(drifted), edges)
    near = [distance_of(between(a, b)) for a, b in zip(true, found.world_from_node, strict=True)]
    assert far[-1] > 0.5 and near[-1] < 0.05 and max(near) < 0.35 * max(far)
    assert (found.weights[-5:] > 0.5).tolist() == [True, True, True, False, False]
    assert (optimize(np.array(drifted), edges).weights[-5:] < 0.5).all(), "from there it believes none"


def test_exact_edges_leave_exact_poses() -> None:
    true = ring(12)
    edges = [Edge(k, (k + 1) % 12, between(true[k], true[(k + 1) % 12]), SURE) for k in range(12)]
    noise = np.random.default_rng(0)
    start = np.array([true[0], *(exponential(noise.normal(0, 0.05, 6)) @ pose for pose in true[1:])])
    found = optimize(start, edges)
    assert max(distance_of(between(a, b)) for a, b in zip(true, found.world_from_node, strict=True)) < 1e-6
    assert max(angle_of(between(a, b)) for a, b in zip(true, found.world_from_node, strict=True)) < 1e-6


def test_a_wrong_loop_is_switched_off() -> None:
    true = ring(24)
    edges = [Edge(k, k + 1, between(true[k], true[k + 1]), SURE) for k in range(23)]
    edges.append(Edge(23, 0, between(true[23], true[0]), SURE, switchable=True))
    edges.append(Edge(0, 12, np.eye(4), SURE, switchable=True))
    found = optimize(true, edges)
    assert found.weights[-1] < 1e-3 and found.weights[-2] > 0.99
    assert max(distance_of(between(a, b)) for a, b in zip(true, found.world_from_node, strict=True)) < 0.02


def test_parts_are_laid_where_a_loop_puts_them() -> None:
    true = np.array([step(k) for k in range(6)])
    edges = [Edge(k, k + 1, step(1.0), SURE) for k in (0, 1, 2, 4)]
    poses = true.copy()
    elsewhere = exponential(np.array([0.3, 0.2, -0.4, 5.0, 1.0, 2.0]))
    poses[4:] = elsewhere @ poses[4:]
    assert parts_of(6, edges).tolist() == [0, 0, 0, 0, 1, 1]
    edges.append(Edge(1, 5, step(4.0), SURE, switchable=True))
    np.testing.assert_allclose(laid_out(poses, edges), true, atol=1e-9)
    backwards = [*edges[:-1], Edge(5, 1, inverse(step(4.0)), SURE, switchable=True)]
    np.testing.assert_allclose(laid_out(poses, backwards), true, atol=1e-9)


def test_no_edges_change_nothing() -> None:
    found = optimize(ring(3), [])
    assert np.array_equal(found.world_from_node, ring(3)) and found.variance_factor == 1.0
