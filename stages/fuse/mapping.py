"""The panoptic map while it is being built: one frame after the other (Han 2024, sections 2.3.2 and 2.3.3)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from schemas.errors import BadInput
from schemas.scene_parts import Camera
from schemas.segments import FrameSegment
from stages.fuse.association import (
    Prediction,
    associate_instances,
    index_segments,
    match_segments,
    measure_overlap,
    overlapping_labels,
)
from stages.fuse.counts import TripleCounts
from stages.fuse.integration import integrate
from stages.fuse.parameters import FuseParameters
from stages.fuse.regularization import MergedLabels, SharedSegments, merge_instances, merge_segments
from stages.fuse.voxel_blocks import COORDINATE_LIMIT, SIDE, VoxelBlocks


class PanopticMapper:
    """Voxel blocks, segment labels, the triple-wise count and what was seen of every instance.

    `things`: class ids of countable objects; all other classes are stuff.
    """

    def __init__(self, parameters: FuseParameters, camera: Camera, things: frozenset[int]) -> None:
        self.parameters = parameters
        self.camera = camera
        self.things = things
        self.blocks = VoxelBlocks(parameters.voxel_size)
        self.labels = MergedLabels()
        self.shared = SharedSegments()
        self.counts = TripleCounts()
        self.seen_in: dict[int, int] = {}
        """Frames in which each instance was predicted, as the bits of an integer."""
        self.frames_integrated = 0
        self.labelled_frames = 0
        self.segment_merges = 0
        self.instance_merges = 0
        self._next_instance = 1

    @property
    def truncation_distance(self) -> float:
        """Metres."""
        return self.parameters.truncation_voxels * self.parameters.voxel_size

    def add_frame(
        self,
        depth: np.ndarray,
        color: np.ndarray | None,
        world_from_camera: np.ndarray,
        ids: np.ndarray | None = None,
        listing: Sequence[FrameSegment] = (),
    ) -> None:
        """Fuse one frame: depth (H, W) float32 [m], colour (H, W, 3) uint8 or None, world_from_camera (4, 4).

        ids (H, W) int32: the frame's panoptic image, whose values `listing` explains; None fuses geometry alone. Raises
        BadInput for an id that is not listed, and for a camera too far from the origin for the voxel grid.
        """
        options = self.parameters
        reach = COORDINATE_LIMIT * options.voxel_size - options.maximum_depth - SIDE * self.truncation_distance
        if not (np.abs(world_from_camera[:3, 3]) < reach).all():
            raise BadInput(
                f"camera at {world_from_camera[:3, 3]} m is outside of the voxel grid (+-{reach:.0f} m)",
                hint="move the origin of the trajectory near the scene",
            )
        index_image, frame_labels = None, np.zeros(1, dtype=np.int32)
        if ids is not None:
            index_image, frame_labels = self._associate(depth, world_from_camera, ids, listing)
        integrate(
            self.blocks, depth, self.camera, world_from_camera, truncation=self.truncation_distance,
            near=options.minimum_depth, far=options.maximum_depth, color=color, index_image=index_image,
            label_of_index=frame_labels, canonical=self.labels.table(), maximum_weight=options.maximum_weight,
            label_band=options.label_band * self.truncation_distance, stride=options.block_stride,
        )  # fmt: skip
        self.frames_integrated += 1
        if self.frames_integrated % options.regularize_every == 0:
            self.regularize()

    def regularize(self) -> None:
        """Merge instance labels that are one instance (eq. 2.5)."""
        options = self.parameters
        for removed, kept in merge_instances(
            self.counts, self.things, threshold=options.instance_threshold, minimum_count=options.instance_minimum_count
        ):
            self.seen_in[kept] = self.seen_in.get(kept, 0) | self.seen_in.pop(removed, 0)
            self.instance_merges += 1

    def _associate(
        self, depth: np.ndarray, world_from_camera: np.ndarray, ids: np.ndarray, listing: Sequence[FrameSegment]
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
            self.blocks, depth, index_image, len(segments), self.camera, world_from_camera,
            canonical=self.labels.table(), near=options.minimum_depth, far=options.maximum_depth,
            stride=options.overlap_stride,
        )  # fmt: skip
        matched = match_segments(
            overlap, minimum_voxels=options.minimum_overlap_voxels, minimum_share=options.minimum_overlap_share
        )
        labels = [self.labels.new() if label == 0 else max(label, 0) for label in matched]
        self.shared.observe(overlapping_labels(overlap, options.merge_overlap_share))
        self._predict(
            [
                Prediction(label, segment.category_id, segment.instance)
                for label, segment in zip(labels, segments, strict=True)
                if label > 0 and segment.category_id > 0
            ]
        )
        self.segment_merges += merge_segments(
            self.shared, self.labels, self.counts, self.things, minimum_frames=options.merge_minimum_frames,
            guarded=options.merging == "ours",
        )  # fmt: skip
        return index_image, np.array([0, *(self.labels.root(label) for label in labels)], dtype=np.int32)

    def _predict(self, predictions: list[Prediction]) -> None:
        """Give every predicted instance its global label and increase the triple-wise count."""
        instances, self._next_instance = associate_instances(predictions, self.counts, self._next_instance)
        for prediction in predictions:
            instance = instances[prediction.frame_instance, prediction.class_id]
            self.counts.add(prediction.segment, prediction.class_id, instance)
            self.seen_in[instance] = self.seen_in.get(instance, 0) | (1 << self.labelled_frames)
        self.labelled_frames += 1
