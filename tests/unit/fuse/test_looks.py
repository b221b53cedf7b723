"""Looks: which thing a mask speaks of, what a thing was seen by, and how many looks are kept."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scenewright.schemas.scene_parts import Camera
from scenewright.schemas.segments import FrameSegment
from scenewright.stages.fuse.looks import FEWEST, KEPT, OVERLAP, Look, Looks, look_of, spoken_of
from scenewright.stages.fuse.names import Said
from scipy.spatial.transform import Rotation

from tests.unit.fuse.scenes import class_id

CHAIR, TABLE, CUP = (class_id(name) for name in ("chair", "table", "cup"))
VOXEL = 0.02
CAMERA = Camera(width=80, height=60, fx=70.0, fy=70.0, cx=39.5, cy=29.5)


def segment(number: int, class_name: int, instance: int, score: float = 1.0) -> FrameSegment:
    return FrameSegment(
        id=number, class_id=class_name, instance=instance, is_thing=True, score=score, area=1, witnesses=()
    )


def test_a_mask_speaks_of_the_thing_that_it_overlaps_most() -> None:
    table, cup = [1] * 80, [2] * 20
    seen, spoken = spoken_of(np.ones(100, int), np.array(table + cup), 1)
    assert seen == [1, 2] and spoken == {1: 1}, "the mask of a table is silent about the cup on it"
    seen, spoken = spoken_of(np.array([1] * 80 + [2] * 20), np.array(table + cup), 2)
    assert spoken == {1: 1, 2: 2}
    assert spoken_of(np.array([1] * 15 + [0] * 85), np.ones(100, int), 1) == ([1], {}), "a small part of a thing"
    assert spoken_of(np.array([1] * 30 + [0] * 70), np.ones(100, int), 1) == ([1], {1: 1})


def test_what_hardly_was_seen_was_not_looked_at() -> None:
    thing = np.array([1] * (FEWEST - 1) + [2] * FEWEST)
    assert spoken_of(np.where(thing == 1, 1, 2), thing, 2) == ([2], {2: 2})
    assert spoken_of(np.zeros(0, int), np.zeros(0, int), 0) == ([], {})
    assert spoken_of(np.ones(50, int), np.zeros(50, int), 1) == ([], {}), "nothing of the map is there"


@settings(max_examples=100, deadline=None)
@given(arrays(np.int64, 60, elements=st.integers(0, 4)), arrays(np.int64, 60, elements=st.integers(0, 3)))
def test_what_is_said_of_which_thing_is_intersection_over_union(mask: np.ndarray, thing: np.ndarray) -> None:
    seen, spoken = spoken_of(mask, thing, 4)
    assert seen == [k for k in (1, 2, 3) if (thing == k).sum() >= FEWEST]
    for m in range(1, 5):
        of = {k: ((mask == m) & (thing == k)).sum() / ((mask == m) | (thing == k)).sum() for k in seen}
        best = max(of.values(), default=0.0)
        assert spoken.get(m) == (min(k for k in of if of[k] == best) if best >= OVERLAP else None)


def test_points_of_a_look_lie_where_the_camera_saw_them() -> None:
    depth = np.full((60, 80), 1.5, np.float32)
    depth[:, :10] = 0.0
    index = np.ones((60, 80), np.uint16)
    index[:, 40:] = 2
    index[:, 60:] = 3
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = Rotation.from_euler("z", 0.3).as_matrix(), (1.0, 2.0, 0.5)
    masks = (segment(4, CHAIR, 1, 0.8), segment(5, CHAIR, 1, 0.8), segment(9, 0, 0))
    look = look_of(CAMERA, depth, index, masks, pose, 0.1, 4.0, VOXEL)
    assert look.said == ((CHAIR, 0.8),), "segments of one instance are a mask, background is none"
    assert set(look.mask.tolist()) == {0, 1} and len(look.mask) == 60 * 70
    rows, columns = np.divmod(np.arange(60 * 80).reshape(60, 80)[:, 10:].ravel(), 80)
    points = np.stack([(columns - 39.5) / 70, (rows - 29.5) / 70, np.ones(len(rows))], axis=1) * 1.5
    np.testing.assert_array_equal(look.voxel, np.floor((points @ pose[:3, :3].T + pose[:3, 3]) / VOXEL).astype(int))
    assert len(look_of(CAMERA, depth, index, masks, pose, 2.0, 4.0, VOXEL).mask) == 0


def flat(looks: Looks, masks: tuple[FrameSegment, ...], index: np.ndarray) -> None:
    """A look straight at the plane z = 1."""
    looks.add_frame(CAMERA, np.ones((60, 80), np.float32), index, masks, np.eye(4), near=0.1, far=4.0)


def plane() -> tuple[np.ndarray, np.ndarray]:
    """Vertices of what `flat` sees: thing 1, with thing 2 in the middle."""
    x, y = np.meshgrid(np.arange(-0.55, 0.55, VOXEL), np.arange(-0.42, 0.42, VOXEL))
    vertices = np.stack([x.ravel(), y.ravel(), np.ones(x.size)], axis=1)
    return vertices, np.where((np.abs(vertices[:, :2]) < 0.1).all(axis=1), 2, 1)


def test_scores_are_means_over_the_looks_that_saw_the_thing() -> None:
    looks, (vertices, instance) = Looks(VOXEL), plane()
    whole, middle = np.ones((60, 80), np.uint16), np.ones((60, 80), np.uint16)
    middle[23:37, 33:47] = 2
    for _ in range(3):
        flat(looks, (segment(1, TABLE, 1, 0.9),), whole)
    flat(looks, (segment(1, TABLE, 1, 0.5), segment(2, CUP, 2, 0.8)), middle)
    said = looks.said_of(looks.on(vertices, instance))
    assert said[1].looks == said[2].looks == 4.0
    assert said[1].scores == {TABLE: pytest.approx((3 * 0.9 + 0.5) / 4)}
    assert said[2].scores == {CUP: pytest.approx(0.2)}
    assert set(looks.said_of(looks.on(vertices, np.zeros_like(instance)))) == set()
    empty = Looks(VOXEL)
    assert empty.said_of(empty.on(vertices, instance)) == {}
    assert looks.said_of(looks.on(np.zeros((0, 3)), np.zeros(0, int))) == {}


def test_of_many_looks_some_are_kept_evenly_and_say_the_same() -> None:
    looks, (vertices, instance) = Looks(VOXEL), plane()
    small = np.zeros((60, 80), np.float32)
    for _ in range(KEPT + 1):
        looks.add_frame(CAMERA, small, np.zeros((60, 80), np.uint16), (), np.eye(4), near=0.1, far=4.0)
    assert looks.every == 2 and len(looks.kept) == KEPT // 2 + 1
    looks = Looks(
        VOXEL,
        kept=(Look(np.floor(vertices / VOXEL).astype(np.int32), np.ones(len(vertices), np.uint16), ((TABLE, 1.0),)),)
        * 5,
    )
    assert looks.said_of(looks.on(vertices, instance))[1] == Said(5.0, {TABLE: 1.0})
