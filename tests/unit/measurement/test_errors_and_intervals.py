"""Poses, trajectories, surfaces, labels by neighbour, bootstrap, tables, layout, plots."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from dataclasses import astuple

import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st
from scenewright.stages.evaluate.mesh_distance import distances_to_mesh, surface_agreement
from scenewright.stages.evaluate.point_labels import nearest_labels
from scenewright.stages.kit.drawing.palette import hex_color, instance_color
from scenewright.stages.kit.drawing.plots import plot_bars, plot_graphs
from scenewright.stages.kit.drawing.tree_layout import tree_layout
from scenewright.stages.kit.measurement.bootstrap import (
    bootstrap_interval,
    figure_interval,
    paired_interval,
    pooled_interval,
)
from scenewright.stages.kit.measurement.pose_error import (
    align_rigidly,
    associate,
    position_error,
    rotation_period,
    trajectory_error,
    yaw_error,
    yaw_of,
)
from scenewright.stages.kit.measurement.tables import Table, as_csv, as_markdown
from scipy.spatial.transform import Rotation


def test_yaw_error():
    assert yaw_error(np.radians(179), np.radians(-179)) == pytest.approx(np.radians(2))
    assert yaw_error(0.0, np.pi) == pytest.approx(np.pi)
    assert yaw_error(0.1, 0.1 + np.pi, period=np.pi) == pytest.approx(0.0, abs=1e-12)
    assert yaw_of(Rotation.from_euler("z", 0.7).as_matrix()) == pytest.approx(0.7)


@given(st.floats(-20, 20), st.floats(-20, 20))
def test_yaw_error_is_the_angle_between_directions(a, b):
    expected = np.arccos(np.clip(np.cos(a) * np.cos(b) + np.sin(a) * np.sin(b), -1, 1))
    assert yaw_error(a, b) == pytest.approx(expected, abs=1e-6)


def test_rotation_period():
    random = np.random.default_rng(0)

    def box(x, y, z):
        return trimesh.creation.box(extents=(x, y, z)).sample(2000, seed=random)

    assert rotation_period(box(0.6, 0.6, 0.4)) == pytest.approx(np.pi / 2)
    assert rotation_period(box(1.2, 0.6, 0.7)) == pytest.approx(np.pi)
    round_ = trimesh.creation.cylinder(radius=0.04, height=0.1).sample(2000, seed=random)
    assert rotation_period(round_) == 0.0
    back = trimesh.creation.box(extents=(0.5, 0.05, 0.5))
    back.apply_translation([0, 0.225, 0.45])
    seat = trimesh.creation.box(extents=(0.5, 0.5, 0.05))
    chair = trimesh.util.concatenate([seat, back]).sample(2000, seed=random)
    assert rotation_period(chair) == pytest.approx(2 * np.pi)
    assert yaw_error(0.0, 1.0, period=0.0) == 0.0


def test_position_error():
    assert position_error(np.zeros(3), np.array([3.0, 4.0, 12.0])) == (13.0, 5.0)


def test_alignment_recovers_a_rigid_motion():
    random = np.random.default_rng(0)
    points = random.normal(size=(20, 3))
    rotation = Rotation.from_rotvec([0.3, -0.8, 1.1]).as_matrix()
    transform = align_rigidly(points, points @ rotation.T + [1.0, 2.0, 3.0])
    assert transform[:3, :3] == pytest.approx(rotation)
    assert transform[:3, 3] == pytest.approx([1.0, 2.0, 3.0])
    with pytest.raises(ValueError, match="three points"):
        align_rigidly(points[:2], points[:2])


def test_trajectory_error_sees_an_offset_that_alignment_removes():
    random = np.random.default_rng(1)
    times = np.arange(10) * 0.1
    truth = np.tile(np.eye(4), (10, 1, 1))
    truth[:, :3, 3] = random.normal(size=(10, 3))
    moved = truth.copy()
    moved[:, 0, 3] += 0.3
    error = trajectory_error(times, truth, times + 0.005, moved)
    assert error.rmse == pytest.approx(0.3)
    assert error.rmse_aligned == pytest.approx(0.0, abs=1e-9)
    assert (error.associated, error.rotation_mean) == (10, pytest.approx(0.0, abs=1e-6))
    assert trajectory_error(times, truth, times + 50.0, moved) is None
    turned = truth.copy()
    turned[:, :3, :3] = Rotation.from_euler("z", 0.2).as_matrix()
    assert trajectory_error(times, truth, times, turned).rotation_mean == pytest.approx(0.2)


def test_association_takes_the_nearest_within_tolerance():
    true_rows, rows = associate(np.array([0.0, 0.1, 0.2]), np.array([0.01, 0.09, 0.15, 0.5]))
    assert true_rows.tolist() == [0, 1]
    assert rows.tolist() == [0, 1]


def test_distance_to_a_triangle():
    vertices = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], dtype=float)
    points = np.array([[0.2, 0.2, 0.5], [-3.0, 0, 0], [0.25, 0.25, 0.0]])
    assert distances_to_mesh(points, vertices, np.array([[0, 1, 2]])) == pytest.approx([0.5, 3.0, 0.0], abs=1e-6)
    assert np.isinf(distances_to_mesh(points, vertices, np.zeros((0, 3)))).all()
    assert distances_to_mesh(np.zeros((0, 3)), vertices, np.array([[0, 1, 2]])).shape == (0,)


def test_surface_agreement():
    agreement = surface_agreement(np.array([0.0, 0.02, 0.2, 0.02]), np.array([0.01, np.inf]), threshold=0.05)
    assert (agreement.precision, agreement.recall) == (0.75, 0.5)
    assert agreement.fscore == pytest.approx(2 * 0.75 * 0.5 / 1.25)
    assert agreement.accuracy_mean == pytest.approx(0.06)
    assert agreement.completeness_mean == pytest.approx((0.01 + 0.5) / 2)
    assert surface_agreement(np.zeros(0), np.zeros(3), 0.05) is None


def test_nearest_labels():
    vertices = np.array([[0.0, 0, 0], [1.0, 0, 0], [2.0, 0, 0]])
    labels = np.array([5, 0, 7])
    points = np.array([[0.01, 0, 0], [1.01, 0, 0], [2.2, 0, 0], [9.0, 0, 0]])
    assert nearest_labels(points, vertices, labels, 0.05).tolist() == [5, 0, 0, 0]
    assert nearest_labels(points, vertices, labels).tolist() == [5, 0, 7, 7]
    assert nearest_labels(points, np.zeros((0, 3)), np.zeros(0), 0.05).tolist() == [0, 0, 0, 0]


def test_bootstrap_covers_the_truth():
    """The 90 % interval of a mean of 40 values holds the true mean in about nine of ten experiments."""
    random = np.random.default_rng(7)
    held = 0
    for _ in range(200):
        interval = bootstrap_interval(random.exponential(size=40), random, level=0.9, resamples=300)
        held += interval.low <= 1.0 <= interval.high
    assert 0.80 <= held / 200 <= 0.95


def test_pooled_intervals_are_those_of_the_figure_called_for_every_draw() -> None:
    """Sums over sums in one array: the same draws, and those with nothing below the line left out."""
    random = np.random.default_rng(4)
    first, second = (np.stack([random.random(12), random.integers(0, 2, 12)], axis=1) for _ in range(2))

    def figure(rows: Sequence[np.ndarray]) -> float | None:
        above, below = np.sum(rows, axis=0)
        return float(above / below) if below else None

    draws = {"resamples": 300}
    called = figure_interval(figure, list(first), np.random.default_rng(3), **draws)
    pooled = pooled_interval(first, None, np.random.default_rng(3), **draws)
    assert astuple(pooled) == pytest.approx(astuple(called))
    called = paired_interval(figure, list(first), list(second), np.random.default_rng(3), **draws)
    pooled = pooled_interval(first, second, np.random.default_rng(3), **draws)
    assert astuple(pooled) == pytest.approx(astuple(called))
    assert pooled_interval(np.zeros((3, 2)), None, np.random.default_rng(3), **draws) is None


def test_bootstrap_is_repeatable_and_handles_little_data():
    values = np.array([1.0, 2.0, 5.0])
    first = bootstrap_interval(values, np.random.default_rng(3))
    assert first == bootstrap_interval(values, np.random.default_rng(3))
    assert first.value == pytest.approx(8 / 3)
    assert first.low < first.value < first.high
    assert bootstrap_interval(np.zeros(0), np.random.default_rng(0)) is None
    middle = bootstrap_interval(values, np.random.default_rng(3), statistic=np.median)
    assert middle.value == 2.0


def test_intervals_of_any_figure_are_those_of_the_mean_for_the_mean():
    values = [0.0, 1.0, 1.0, 3.0, 7.0]
    found = figure_interval(lambda rooms: float(np.mean(rooms)), values, np.random.default_rng(3), resamples=500)
    assert found == bootstrap_interval(np.array(values), np.random.default_rng(3), resamples=500)
    assert figure_interval(lambda rooms: None, values, np.random.default_rng(3), resamples=5) is None
    first_alone = figure_interval(
        lambda rooms: 2.0 if rooms == values else None, values, np.random.default_rng(3), resamples=5
    )
    assert first_alone is not None and (first_alone.low, first_alone.high) == (2.0, 2.0)


def test_paired_intervals_are_those_of_the_differences():
    first, second = [3.0, 5.0, 4.0, 9.0], [1.0, 2.0, 4.0, 6.0]
    found = paired_interval(lambda rooms: float(np.mean(rooms)), first, second, np.random.default_rng(3), resamples=500)
    expected = bootstrap_interval(np.array(first) - np.array(second), np.random.default_rng(3), resamples=500)
    assert found is not None and expected is not None
    assert (found.value, found.low, found.high) == pytest.approx((expected.value, expected.low, expected.high))
    with pytest.raises(ValueError, match="no pairs"):
        paired_interval(lambda rooms: 1.0, first, second[1:], np.random.default_rng(3), resamples=5)


def test_tables():
    table = Table("t", "A table", ("name", "value"), (("a|b", 0.12345), ("c,d", None)), "note")
    assert list(csv.reader(io.StringIO(as_csv(table)))) == [["name", "value"], ["a|b", "0.12345"], ["c,d", ""]]
    markdown = as_markdown(table)
    assert "| a\\|b | 0.123 |" in markdown
    assert "| c,d | – |" in markdown
    assert markdown.endswith("note\n")


def test_tree_layout_puts_parents_at_the_middle_of_their_children():
    layout = tree_layout({"scene": None, "floor": "scene", "a": "floor", "b": "floor", "c": "floor", "wall": "scene"})
    assert [layout[n][1] for n in ("a", "b", "c")] == [0.0, 1.0, 2.0]
    assert layout["floor"] == (1.0, 1.0)
    assert len({position for position in layout.values()}) == len(layout)
    with pytest.raises(ValueError, match="circle"):
        tree_layout({"a": "b", "b": "a"})


def test_instance_colors_differ():
    colors = {hex_color(instance_color(k)) for k in range(1, 41)}
    assert len(colors) == 40
    assert hex_color(instance_color(0)) == "#757370"


def test_plots_are_the_same_bytes_every_time(tmp_path):
    for name in ("a.png", "b.png"):
        plot_bars(tmp_path / name, ["chair", "cup"], {"PQ": [0.5, None]}, title="t", axis="x")
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()
    assert b"matplotlib" not in (tmp_path / "a.png").read_bytes().lower()


def test_plot_of_graphs_without_nodes(tmp_path):
    from scenewright.schemas.contact_graph import ContactGraphFile

    plot_graphs(tmp_path / "g.png", {"empty": ContactGraphFile(nodes=(), links=())}, marked={}, title="nothing")
    assert (tmp_path / "g.png").stat().st_size > 500
