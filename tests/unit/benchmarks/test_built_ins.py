"""What stands for built-ins, held against true surface: what is right costs nothing, what is off says by how much."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import trimesh
from scenewright.schemas.contact_graph import GraphNode
from scenewright.stages.kit.geometry.boxes import box_from_bounds

from benchmarks.experiments.built_ins import EXPERIMENT, Judge, Stood

LOW, HIGH = np.array([0.0, 0.0, 0.0]), np.array([1.0, 0.6, 0.9])


@pytest.fixture
def judge(tmp_path: Path) -> Judge:
    """A cabinet that is a box, whose top and front were seen, and mapped where they are."""
    cabinet = trimesh.creation.box(bounds=(LOW, HIGH))
    for name in ("mesh.ply", "entity.ply"):
        cabinet.export(tmp_path / name)
    across, up = np.meshgrid(np.linspace(0.02, 0.98, 30), np.linspace(0.02, 0.58, 20))
    top = np.stack([across, up, np.full_like(across, 0.9)], axis=-1).reshape(-1, 3)
    front = np.stack([across, np.zeros_like(across), 1.5 * up], axis=-1).reshape(-1, 3)
    np.savez(tmp_path / "visible.npz", points=np.concatenate([top, front]).astype(np.float32))
    held: Any = SimpleNamespace(path=lambda name: tmp_path / name)
    scene: Any = SimpleNamespace(info=SimpleNamespace(replacements=[]))
    return Judge(held, np.eye(4), held, scene)


def node(raised: float = 0.0) -> GraphNode:
    lift = np.array([0.0, 0.0, raised])
    return GraphNode(
        id="cabinet_1",
        instance=1,
        class_name="cabinet",
        node_type="rigid",
        mesh="entity.ply",
        box=box_from_bounds(LOW + lift, HIGH + lift),
    )


def test_a_box_that_is_the_thing_is_nowhere_off(judge: Judge) -> None:
    right = judge._one("box", node(), [])
    assert (right.built, right.pieces, right.leaves) == (1, 1, 0)
    assert right.seen < 1e-4 and right.made < 1e-4
    assert right.level == right.level_kept > 0


def test_a_box_that_is_raised_is_off_and_loses_the_level(judge: Judge) -> None:
    raised = judge._one("box", node(raised=0.05), [])
    assert 0.01 < raised.seen < 0.05 and raised.made > 0.01
    assert raised.level > 0 and raised.level_kept == 0


def test_things_without_a_built_in_are_eligible_and_in_no_mean(judge: Judge) -> None:
    cup = node().model_copy(update={"id": "cup_2", "class_name": "cup"})
    assert judge.of("box", [node(), cup], []) == Stood(1, 0, 0.0, 0.0, 0.0, 0.0, 0, 0, 0)


def test_figures_are_means_over_built_ins_in_millimetres_and_shares_of_level() -> None:
    records = [Stood(3, 2, 0.02, 0.01, 10.0, 9.0, 8, 2, 1), Stood(1, 1, 0.01, 0.02, 30.0, 11.0, 1, 0, 0)]
    shown = {name: measure.of(records) for name, measure in EXPERIMENT.measures.items()}
    assert shown == pytest.approx(
        {
            "eligible": 4,
            "built": 3,
            "seen": 10,
            "made": 10,
            "level_kept": 50,
            "pieces": 3,
            "leaves": 2,
            "false_leaves": 1,
        }
    )
    none = [Stood(2, 0, 0.0, 0.0, 0.0, 0.0, 0, 0, 0)]
    assert EXPERIMENT.measures["seen"].of(none) is None and EXPERIMENT.measures["level_kept"].of(none) is None
