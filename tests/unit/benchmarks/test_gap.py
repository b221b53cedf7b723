"""The gap between real and generated rooms: precision of boxes, outlines of things that others hide."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import trimesh
from scenewright.schemas.scene_parts import Camera, Joint
from scenewright.stages.evaluate.model_shapes import ModelShape, PartShape, PlacedShape
from scenewright.stages.kit.formats.frames import Frame

from benchmarks.experiments.gap import (
    GENERATED,
    SCANNET,
    Compared,
    GapParameters,
    mean_of,
    of_outlines,
    outlined,
    precision_at,
    seeds_of,
    surface_of,
)

CAMERA = Camera(width=40, height=40, fx=40.0, fy=40.0, cx=19.5, cy=19.5)


def scene(iou: list[list[float]], confidence: list[float], true: int) -> Compared:
    return Compared(tuple(map(tuple, iou)), tuple(confidence), true)


def test_precision_counts_what_is_found_at_the_asked_overlap_alone() -> None:
    found = scene([[0.9, 0.0], [0.0, 0.3]], [2.0, 1.0], 2)
    assert precision_at(0.25).of([found]) == pytest.approx(100.0)
    assert precision_at(0.5).of([found]) == pytest.approx(50.0)
    assert precision_at(0.25).of([Compared(amodal=(0.5,))]) is None, "the bin has no boxes"


def test_predictions_of_one_scene_match_no_truth_of_another() -> None:
    found, empty = scene([[0.9]], [1.0], 1), scene([], [], 1)
    assert precision_at(0.25).of([found, empty]) == pytest.approx(50.0)


def test_outlines_are_averaged_over_things_not_over_frames() -> None:
    records = [Compared(amodal=(1.0, 0.5, 0.6)), Compared(amodal=(0.1,), hidden=(0.1,))]
    assert mean_of("amodal").of(records) == pytest.approx(55.0)
    assert mean_of("hidden").of(records) == pytest.approx(10.0)
    assert mean_of("hidden").of(records[:1]) is None


def test_a_things_outline_goes_on_behind_what_hides_it_and_not_into_free_space(tmp_path: Path) -> None:
    """A plate 2 m away, its right third behind a board at 1 m; beside the plate the wall behind is seen."""
    plate = trimesh.creation.box(extents=(1.0, 1.0, 0.02))
    plate.apply_translation((0.0, 0.0, 2.0))
    plate.export(tmp_path / "plate.ply")
    made: Any = SimpleNamespace(
        info=SimpleNamespace(entities=[SimpleNamespace(mesh="plate.ply")]), path=lambda name: tmp_path / name
    )
    whole = np.zeros((40, 40), bool)
    whole[10:30, 10:30] = True
    depth = np.where(whole, 1.99, 3.0).astype(np.float32)
    depth[:, 24:] = 1.0
    seen = whole & (depth > 1.5)
    frame = Frame(0, 0.0, None, depth, None, np.eye(4))
    (outline,) = outlined(made, frame, CAMERA, seen[None])
    assert outline[~whole].mean() < 0.03 and (outline & whole).sum() > 0.95 * whole.sum() > 1.2 * seen.sum()
    nothing = np.zeros((40, 40), bool)
    nothing[:5, :5] = True
    (other,) = outlined(made, frame, CAMERA, nothing[None])
    assert (other == nothing).all(), "a mask that no entity covers stays as it was given"


def test_a_thing_is_hidden_where_a_good_part_of_its_outline_is_not_seen() -> None:
    whole = np.zeros((2, 40, 40), bool)
    whole[:, 10:30, 10:30] = True
    seen = whole.copy()
    seen[0, 10] = seen[1, 10:20] = False  # a twentieth, and half
    compared = of_outlines(list(seen), list(seen), list(whole))
    assert compared.amodal == pytest.approx((0.95, 0.5)) and compared.hidden == pytest.approx((0.5,))


def test_a_models_surface_stands_where_it_is_with_its_door_open() -> None:
    """A leaf of half a metre, open by a quarter turn, in a cupboard that is twice as large as its model and turned."""
    leaf = np.array([[[0.0, 0.0, 0.0], [0.5, 0.0, 0.0], [0.5, 0.0, 1.0]]])
    joint = Joint(name="door", type="revolute", part="leaf", axis=(0, 0, 1), origin=(0, 0, 0), lower=0, upper=2)
    parts = {"body": PartShape(leaf, (0, 0, 0)), "leaf": PartShape(leaf, (0, 0, 0))}
    shape = ModelShape("cupboard", "cabinet", parts, (joint,))
    pose = np.array([[0.0, -1, 0, 1], [1, 0, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])
    corners = surface_of(PlacedShape(shape, pose, 2.0, {"door": np.pi / 2}))
    assert corners[1] == pytest.approx([1, 1, 0]) and corners[4] == pytest.approx([0, 0, 0])


def test_what_is_not_there_is_not_measured(tmp_path: Path) -> None:
    bench: Any = SimpleNamespace(parameters=GapParameters(data=tmp_path))
    assert seeds_of(bench, SCANNET) == [] and len(seeds_of(bench, GENERATED)) > 1
    (tmp_path / "mmdet3d_boxes").mkdir()
    assert seeds_of(bench, SCANNET) == [SCANNET]
