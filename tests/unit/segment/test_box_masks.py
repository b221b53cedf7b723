"""Boxes become masks of the thing and not of what is around it."""

from __future__ import annotations

import numpy as np
import pytest
from scenewright.schemas.scene_parts import Camera
from scenewright.schemas.vocabulary import load_vocabulary
from scenewright.stages.kit.class_extents import extent_of, is_plausible
from scenewright.stages.kit.geometry.transforms import look_at
from scenewright.stages.segment.backends.detector.agreement import Thing
from scenewright.stages.segment.backends.detector.backend import merge_duplicates, paint
from scenewright.stages.segment.backends.detector.box_masks import FrameGeometry, box_mask, frame_geometry
from scenewright.stages.segment.geometric import segment_depth

from tests.unit.segment.scenes import combine

VOCABULARY = load_vocabulary()
WIDE = Camera(width=320, height=240, fx=280.0, fy=280.0, cx=159.5, cy=119.5)


def world_depth(camera: Camera, world_from_camera: np.ndarray, boxes: list[tuple[np.ndarray, np.ndarray]]) -> tuple:
    """Depth and surface number of axis-aligned world boxes (low, high), seen from outside or inside of each."""
    v, u = np.mgrid[0 : camera.height, 0 : camera.width].astype(float)
    directions = np.stack([(u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy, np.ones_like(u)], axis=-1)
    world = directions @ world_from_camera[:3, :3].T
    eye = world_from_camera[:3, 3]
    depths = []
    for low, high in boxes:
        with np.errstate(divide="ignore", invalid="ignore"):
            first, second = (np.asarray(low) - eye) / world, (np.asarray(high) - eye) / world
        near, far = np.minimum(first, second).max(axis=-1), np.maximum(first, second).min(axis=-1)
        hit = near <= far
        depths.append(np.where(hit & (near > 1e-6), near, np.where(hit & (far > 1e-6), far, np.inf)))
    return combine(*depths)


ROOM = (np.array([-2.0, -2.0, 0.0]), np.array([2.0, 2.0, 2.6]))
TABLE_TOP = (np.array([-0.6, 0.2, 0.70]), np.array([0.6, 1.0, 0.74]))
CUP = (np.array([-0.05, 0.5, 0.74]), np.array([0.04, 0.59, 0.84]))
UNIT = (np.array([0.8, 1.4, 0.0]), np.array([2.0, 2.0, 0.9]))
FRIDGE = (np.array([-2.0, 1.3, 0.0]), np.array([-1.3, 2.0, 1.8]))
SCENE = [ROOM, TABLE_TOP, CUP, UNIT, FRIDGE]


def see(eye: list[float], target: list[float], camera: Camera = WIDE) -> tuple:
    pose = look_at(np.array(eye), np.array(target))
    depth, which = world_depth(camera, pose, SCENE)
    return segment_depth(depth, camera), which, pose


def box_around(mask: np.ndarray, margin: int = 2) -> np.ndarray:
    rows, columns = np.nonzero(mask)
    return np.array([columns.min() - margin, rows.min() - margin, columns.max() + margin, rows.max() + margin])


def geometry_of(frame, pose: np.ndarray, one_segment: bool = False) -> FrameGeometry:
    labels = (frame.points[..., 2] > 0).astype(np.int32) if one_segment else frame.labels
    return frame_geometry(labels, frame.points, frame.normals, pose)


def overlap(first: np.ndarray, second: np.ndarray) -> float:
    return float((first & second).sum() / (first | second).sum())


def test_the_table_does_not_swallow_the_cup() -> None:
    """Even when no crease separates the two: cup and table are one geometric segment here."""
    frame, which, pose = see([0.2, -0.4, 1.3], [0.0, 0.55, 0.74])
    labels = np.where((which == 2) | (which == 3), 1, 0).astype(np.int32)
    geometry = frame_geometry(labels, frame.points, frame.normals, pose)
    cup = box_mask(box_around(which == 3, 5), geometry)
    assert overlap(cup, which == 3) > 0.7
    assert (cup & (which == 2)).sum() < 0.15 * cup.sum()


def test_own_segments_make_the_mask() -> None:
    frame, which, pose = see([0.2, -0.4, 1.3], [0.0, 0.55, 0.74])
    geometry = geometry_of(frame, pose)
    assert overlap(box_mask(box_around(which == 3, 4), geometry), which == 3) > 0.7


def test_a_table_loses_what_stands_on_it_and_the_floor_below() -> None:
    frame, which, pose = see([0.3, -1.2, 1.5], [0.0, 0.5, 0.7])
    geometry = frame_geometry(frame.labels, frame.points, frame.normals, pose)
    table = box_mask(box_around((which == 2) | (which == 3)), geometry, large_face=True, flat_topped=True)
    assert overlap(table, which == 2) > 0.8
    # The lowest 3 cm of the cup's 10 are within the clearance; the cup's own mask lies over them in the end.
    assert (table & (which == 3)).sum() < 0.4 * (which == 3).sum()
    assert not (table & (which == 1)).sum() > 0.1 * table.sum()


def test_the_background_in_a_box_is_left_out() -> None:
    frame, which, pose = see([-1.0, -1.0, 1.4], [-1.7, 1.6, 0.9])
    geometry = geometry_of(frame, pose)
    fridge = box_mask(box_around(which == 5, 6), geometry, large_face=True)
    assert overlap(fridge, which == 5) > 0.8


def test_an_empty_or_outlying_box_gives_nothing() -> None:
    frame, _, pose = see([0.2, -0.4, 1.3], [0.0, 0.55, 0.74])
    geometry = geometry_of(frame, pose)
    for box in ([10, 10, 10, 40], [400, 300, 500, 400], [-50, -50, -10, -10]):
        assert not box_mask(np.array(box, dtype=float), geometry).any()
    blind = frame_geometry(
        np.zeros((120, 160), np.int32), np.zeros((120, 160, 3), np.float32), np.zeros((120, 160, 3), np.float32), None
    )
    assert not box_mask(np.array([10, 10, 50, 50]), blind).any()


def test_sizes_correct_the_detector() -> None:
    assert is_plausible("cup", 0.12, cut_off=False) and not is_plausible("cup", 0.6, cut_off=False)
    assert not is_plausible("fridge", 0.2, cut_off=False) and is_plausible("fridge", 0.2, cut_off=True)
    assert is_plausible("object", 99.0, cut_off=False)
    points = np.random.default_rng(0).uniform(0, 1, (5000, 3))
    points[0] = 100.0
    assert extent_of(points) == pytest.approx(0.96 * np.sqrt(3), rel=0.02)


def rectangle(top: int, left: int, bottom: int, right: int) -> np.ndarray:
    mask = np.zeros((120, 160), dtype=bool)
    mask[top:bottom, left:right] = True
    return mask


def test_duplicates_are_merged_and_small_things_painted_on_top() -> None:
    chair, cup, table = (VOCABULARY.by_name(name) for name in ("chair", "cup", "table"))
    back, whole = rectangle(0, 0, 40, 40), rectangle(10, 0, 80, 40)
    merged = merge_duplicates([Thing(chair, 0.5, whole), Thing(chair, 0.7, back)])
    assert len(merged) == 1 and merged[0].score == 0.7 and (merged[0].mask == (back | whole)).all()
    apart = merge_duplicates([Thing(chair, 0.5, back), Thing(chair, 0.7, rectangle(60, 60, 90, 90))])
    assert len(apart) == 2
    contest = merge_duplicates([Thing(cup, 0.4, back), Thing(chair, 0.6, back)])
    assert [item.semantic.name for item in contest] == ["chair"]
    unnamed = Thing(VOCABULARY.by_name("object"), 0.9, back)
    assert [item.semantic.name for item in merge_duplicates([unnamed, Thing(chair, 0.4, back)])] == ["chair"]
    small, large = rectangle(20, 20, 30, 30), rectangle(0, 0, 100, 100)
    frame = paint([Thing(cup, 0.4, small), Thing(table, 0.9, large)], (120, 160))
    names = {VOCABULARY.by_id(mask.class_id).name: number for number, mask in frame.masks.items()}
    assert frame.ids[25, 25] == names["cup"] and frame.ids[5, 5] == names["table"]
    assert frame.ids[60, 20] == names["table"] and frame.ids[110, 150] == 0


def test_a_table_without_foreground_in_its_box_gives_no_mask() -> None:
    """Its pixels have depth, but all of them belong to a segment that reaches far out of the box."""
    height, width = 40, 60
    labels = np.ones((height, width), dtype=np.int32)
    points = np.dstack([*np.meshgrid(np.arange(width) * 0.01, np.arange(height) * 0.01), np.full((height, width), 2.0)])
    normals = np.tile([0.0, 0.0, -1.0], (height, width, 1))
    geometry = frame_geometry(labels, points, normals, np.eye(4))
    box = np.array([20.0, 10.0, 40.0, 30.0])
    assert not box_mask(box, geometry, flat_topped=True).any()
