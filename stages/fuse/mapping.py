"""The panoptic map while it is being built: one frame after the other (Han 2024, sections 2.3.2 and 2.3.3)."""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy, deepcopy
from itertools import combinations

import numpy as np

from schemas.errors import BadInput
from schemas.scene_parts import Camera
from schemas.segments import FrameSegment
from stages.fuse.association import (
    Overlap,
    Prediction,
    associate_instances,
    index_segments,
    match_segments,
    measure_overlap,
    overlapping_labels,
)
from stages.fuse.class_scores import ClassScores
from stages.fuse.counts import TripleCounts
from stages.fuse.integration import integrate
from stages.fuse.parameters import FuseParameters
from stages.fuse.regularization import (
    MergedLabels,
    PairEvidence,
    label_pairs,
    merge_evident_instances,
    merge_instances,
    merge_segments,
    merge_stuff,
)
from stages.fuse.separate import SeparateCounts, associate_separately
from stages.fuse.voxel_blocks import COORDINATE_LIMIT, SIDE, VoxelBlocks

FIRST_FORGETTING = 4000
"""Segment labels from which on those without a voxel are looked for, each time that their number has doubled."""


class PanopticMapper:
    """Voxel blocks, segment labels, the triple-wise count and what was seen of every instance.

    `things`: class ids of countable objects; all other classes are stuff.
    """

    def __init__(self, parameters: FuseParameters, things: frozenset[int]) -> None:
        self.parameters = parameters
        self.things = things
        self.blocks = VoxelBlocks(parameters.voxel_size)
        self.labels = MergedLabels()
        self.shared = PairEvidence()
        self.instance_evidence = PairEvidence()
        self.segment_evidence = PairEvidence()
        """Segment labels that frames saw in one instance of a thing, or in two."""
        self.class_scores = ClassScores()
        self.sightings: dict[int, int] = {}
        """Frame segments that each segment label was matched to, predicted or background."""
        self.counts = SeparateCounts() if parameters.merging == "separate" else TripleCounts()
        self.seen_in: dict[int, int] = {}
        """Frames in which each instance was predicted, as the bits of an integer."""
        self.frames_integrated = 0
        self.labelled_frames = 0
        self.segment_merges = 0
        self.instance_merges = 0
        self._next_instance = 1
        self._labels_to_forget_at = FIRST_FORGETTING

    @property
    def truncation_distance(self) -> float:
        """Metres."""
        return self.parameters.truncation_voxels * self.parameters.voxel_size

    def held(self) -> PanopticMapper:
        """Return a mapper of the same voxels that can be closed without a trace in this one: closing merges labels.

        It shares the voxel blocks and is good until the next frame.
        """
        other = copy(self)
        for name in ("labels", "shared", "instance_evidence", "segment_evidence", "class_scores", "counts"):
            setattr(other, name, deepcopy(getattr(self, name)))
        other.sightings, other.seen_in = dict(self.sightings), dict(self.seen_in)
        return other

    def add_frame(
        self,
        camera: Camera,
        depth: np.ndarray,
        color: np.ndarray | None,
        world_from_camera: np.ndarray,
        ids: np.ndarray | None = None,
        listing: Sequence[FrameSegment] = (),
    ) -> None:
        """Fuse one frame: depth (H, W) float32 [m], colour (H, W, 3) uint8 or None, world_from_camera (4, 4).

        ids (H, W) int32: the frame's panoptic image, whose values `listing` explains; None fuses geometry alone. Raises
        BadInput for images of different sizes, for an id that is not listed, and for a camera too far from the origin
        for the voxel grid.
        """
        options = self.parameters
        expected = (camera.height, camera.width)
        for name, image in (("depth", depth), ("colour", color), ("segments", ids)):
            if image is not None and image.shape[:2] != expected:
                raise BadInput(
                    f"{name} of the frame is {image.shape[1]}x{image.shape[0]}, the camera {expected[1]}x{expected[0]}",
                    hint="make the artifact again",
                )
        reach = COORDINATE_LIMIT * options.voxel_size - options.maximum_depth - SIDE * self.truncation_distance
        if not (np.abs(world_from_camera[:3, 3]) < reach).all():
            raise BadInput(
                f"camera at {world_from_camera[:3, 3]} m is outside of the voxel grid (+-{reach:.0f} m)",
                hint="move the origin of the trajectory near the scene",
            )
        index_image, frame_labels = None, np.zeros(1, dtype=np.int32)
        if ids is not None:
            index_image, frame_labels = self._associate(camera, depth, world_from_camera, ids, listing)
        integrate(
            self.blocks, depth, camera, world_from_camera, truncation=self.truncation_distance,
            near=options.minimum_depth, far=options.maximum_depth, color=color, index_image=index_image,
            label_of_index=frame_labels, canonical=self.labels.table(), maximum_weight=options.maximum_weight,
            label_band=options.label_band * self.truncation_distance, stride=options.block_stride,
        )  # fmt: skip
        self.frames_integrated += 1
        if self.frames_integrated % options.regularize_every == 0:
            self.regularize()
        if len(self.sightings) >= self._labels_to_forget_at and options.merging == "ours":
            self._forget_lost_labels()
            self._labels_to_forget_at = max(FIRST_FORGETTING, 2 * len(self.sightings))

    def regularize(self) -> None:
        """Merge instance labels that are one instance (eq. 2.5; in `ours` also all of a stuff class, and those that
        frames saw as one)."""
        options = self.parameters
        if options.merging == "separate":
            return
        done: list[tuple[int, int]] = []
        if options.merging == "ours":
            done += merge_stuff(self.counts, self.things)
            done += merge_evident_instances(
                self.instance_evidence, self.counts, minimum_frames=options.instance_minimum_frames
            )
        by_count = merge_instances(
            self.counts, self.things, threshold=options.instance_threshold, minimum_count=options.instance_minimum_count
        )
        for removed, kept in by_count:
            self.instance_evidence.rename(removed, kept)
        for removed, kept in done + by_count:
            self.seen_in[kept] = self.seen_in.get(kept, 0) | self.seen_in.pop(removed, 0)
            self.instance_merges += 1

    def _forget_lost_labels(self) -> None:
        """Drop what was counted for segment labels that hold no voxel any more.

        No frame can be matched to such a label again, and a camera that stands still makes some in every frame: what is
        kept would follow the log and not the map.
        """
        table = self.labels.table()
        alive = np.zeros(len(table), dtype=bool)
        alive[self.blocks.segment[: self.blocks.count].ravel()] = True
        roots = set(table[alive].tolist())
        for label in [label for label in self.sightings if label not in roots]:
            del self.sightings[label]
            self.counts.forget(label)
            self.class_scores.forget(label)
            self.shared.forget(label)
            self.segment_evidence.forget(label)

    def _associate(
        self,
        camera: Camera,
        depth: np.ndarray,
        world_from_camera: np.ndarray,
        ids: np.ndarray,
        listing: Sequence[FrameSegment],
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return the frame's index image and the global label of every index; count the predictions (eq. 2.4)."""
        options = self.parameters
        segments = sorted(listing, key=lambda segment: segment.id)
        sorted_ids = np.array([segment.id for segment in segments], dtype=np.int32)
        index_image, unlisted = index_segments(np.ascontiguousarray(ids, dtype=np.int32), sorted_ids)
        if unlisted >= 0:
            raise BadInput(
                f"segment id {unlisted} is in the panoptic image but not in segments.json",
                hint="run `scenewright segment` again",
            )
        overlap = measure_overlap(
            self.blocks, depth, index_image, len(segments), camera, world_from_camera,
            canonical=self.labels.table(), near=options.minimum_depth, far=options.maximum_depth,
            stride=options.overlap_stride,
        )  # fmt: skip
        matched = match_segments(
            overlap, minimum_voxels=options.minimum_overlap_voxels, minimum_share=options.minimum_overlap_share
        )
        labels = [self.labels.new() if label == 0 else max(label, 0) for label in matched]
        self._observe_shared(overlap, segments, labels)
        self._predict(
            [
                Prediction(label, segment.category_id, segment.instance, segment.score)
                for label, segment in zip(labels, segments, strict=True)
                if label > 0 and segment.category_id > 0
            ],
            [label for label, segment in zip(labels, segments, strict=True) if label > 0 and segment.category_id == 0],
        )
        for label in labels:
            if label > 0:
                self.sightings[label] = self.sightings.get(label, 0) + 1
        merged = merge_segments(
            self.shared, self.labels, self.counts, minimum_frames=options.merge_minimum_frames,
            contested=options.merging == "ours",
        )  # fmt: skip
        for removed, kept in merged:
            self.sightings[kept] = self.sightings.get(kept, 0) + self.sightings.pop(removed, 0)
            self.segment_evidence.rename(removed, kept)
            self.class_scores.merge_segments(removed, kept)
        self.segment_merges += len(merged)
        return index_image, np.array([0, *(self.labels.root(label) for label in labels)], dtype=np.int32)

    def _observe_shared(self, overlap: Overlap, segments: Sequence[FrameSegment], labels: Sequence[int]) -> None:
        """Count which global labels lie together in a segment of this frame, and which apart."""
        options = self.parameters
        inside = overlapping_labels(overlap, options.merge_overlap_share)
        groups = [
            label_pairs(group, segment.category_id, self.counts, guarded=options.merging == "ours")
            for group, segment in zip(inside, segments, strict=True)
        ]
        self.shared.observe(groups, [label for label in labels if label > 0] if options.merging == "ours" else [])

    def _predict(self, predictions: list[Prediction], unpredicted: list[int]) -> None:
        """Give every predicted instance its global label and increase the triple-wise count."""
        if isinstance(self.counts, SeparateCounts):
            instances, self._next_instance = associate_separately(
                predictions, unpredicted, self.counts, self._next_instance
            )
        else:
            self._observe_instances(predictions)
            instances, self._next_instance = associate_instances(predictions, self.counts, self._next_instance)
        for prediction in predictions:
            instance = instances[prediction.frame_instance, prediction.class_id]
            self.counts.add(prediction.segment, prediction.class_id, instance)
            self.class_scores.add(prediction.segment, prediction.class_id, prediction.score)
            self.seen_in[instance] = self.seen_in.get(instance, 0) | (1 << self.labelled_frames)
        self.labelled_frames += 1

    def _observe_instances(self, predictions: list[Prediction]) -> None:
        """Count which segments and which instances of things the frame sees as one, and which as two: a frame instance
        stands for the leading instances of the global segments that it lies on."""
        of_things = [p for p in predictions if p.class_id in self.things]
        parts: dict[int, set[int]] = {}
        for prediction in of_things:
            parts.setdefault(prediction.frame_instance, set()).add(prediction.segment)
        self.segment_evidence.observe(
            [list(combinations(sorted(labels), 2)) for labels in parts.values()], {p.segment for p in of_things}
        )
        homes: dict[int, dict[int, set[int]]] = {}
        for prediction in predictions:
            best = self.counts.best(prediction.segment)
            if prediction.class_id in self.things and best is not None and best[0] == prediction.class_id:
                homes.setdefault(best[0], {}).setdefault(prediction.frame_instance, set()).add(best[1])
        for by_instance in homes.values():
            groups = [list(combinations(sorted(labels), 2)) for labels in by_instance.values()]
            self.instance_evidence.observe(groups, set().union(*by_instance.values()))
