"""Labels that hold no voxel are forgotten, as if they had never been counted."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scenewright.schemas.segments import FrameSegment
from scenewright.stages.fuse import ours
from scenewright.stages.fuse.counts import TripleCounts
from scenewright.stages.fuse.mapping import PanopticMapper
from scenewright.stages.fuse.parameters import FuseParameters
from scenewright.stages.fuse.regularization import PairEvidence

from tests.unit.fuse.scenes import CAMERA, class_id

triples = st.lists(st.tuples(st.integers(1, 4), st.integers(1, 3), st.integers(1, 3)), max_size=25)


def contents(counts: TripleCounts) -> tuple:
    keys = {key for row in counts.by_segment.values() for key in row}
    return (
        counts.by_segment,
        {key: (counts.total(*key), set(counts.segments(*key))) for key in sorted(keys)},
        {c: found for c, found in counts.instances_of().items() if found},
    )


@given(triples, st.integers(1, 4))
@settings(max_examples=60, deadline=None)
def test_forgetting_counts_undoes_counting(added: list[tuple[int, int, int]], gone: int) -> None:
    counts, without = TripleCounts(), TripleCounts()
    for segment, class_id_, instance in added:
        counts.add(segment, class_id_, instance)
        if segment != gone:
            without.add(segment, class_id_, instance)
    counts.forget(gone)
    assert contents(counts) == contents(without)
    assert counts.take_changed("rule") == without.take_changed("rule")


@given(st.lists(st.lists(st.integers(1, 5), min_size=2, max_size=3, unique=True), max_size=8), st.integers(1, 5))
@settings(max_examples=60, deadline=None)
def test_forgetting_pairs_undoes_observing(frames: list[list[int]], gone: int) -> None:
    evidence, without = PairEvidence(), PairEvidence()
    for labels in frames:
        evidence.observe([list(combinations(sorted(labels[:2]), 2))], labels)
        kept = [label for label in labels if label != gone]
        without.observe([[pair] for pair in combinations(sorted(labels[:2]), 2) if gone not in pair], kept)
    evidence.forget(gone)
    assert (evidence.together, evidence.apart) == (without.together, without.apart)
    for contested in (False, True):
        assert evidence.due(1, contested=contested) == without.due(1, contested=contested)


def test_a_camera_that_stands_still_fills_no_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    """Every frame gives the wall another segment in a new place, which the next ones vote down."""
    monkeypatch.setattr(ours, "FIRST_FORGETTING", 30)
    chair = class_id("chair")
    parameters = FuseParameters(voxel_size=0.05)
    merging = ours.Ours(parameters, frozenset({chair}))
    mapper = PanopticMapper(parameters, merging)
    depth = np.full((CAMERA.height, CAMERA.width), 1.5, dtype=np.float32)
    random = np.random.default_rng(0)
    for _ in range(150):
        ids = np.ones(depth.shape, dtype=np.int32)
        rows, columns = random.integers(0, CAMERA.height - 12), random.integers(0, CAMERA.width - 12)
        ids[rows : rows + 12, columns : columns + 12] = 2
        listing = [
            FrameSegment(id=1, class_id=0, instance=0, is_thing=False, score=0.0, area=1),
            FrameSegment(id=2, class_id=chair, instance=1, is_thing=True, score=1.0, area=144),
        ]
        mapper.add_frame(CAMERA, depth, None, np.eye(4), ids, listing)
    roots = mapper.labels.table()
    assert roots.max() > 60, "labels were made all the time"
    held = set(roots[np.unique(mapper.blocks.segment[: mapper.blocks.count])].tolist())
    limit = max(30, 2 * len(held)) + 2
    assert len(mapper.sightings) <= limit and len(merging.counts.by_segment) <= limit
    assert set(merging.shared.apart) <= set(mapper.sightings)
