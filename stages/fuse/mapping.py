"""The panoptic map while it is being built: one frame after the other (Han 2024, sections 2.3.2 and 2.3.3)."""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy, deepcopy

import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.schemas.scene_parts import Camera
from scenewright.schemas.segments import FrameSegment
from scenewright.stages.fuse.association import (
    Prediction,
    index_segments,
    match_segments,
    measure_overlap,
    overlapping_labels,
)
from scenewright.stages.fuse.exposure import Exposure
from scenewright.stages.fuse.free_space import FreeSpace
from scenewright.stages.fuse.integration import integrate
from scenewright.stages.fuse.looks import Looks
from scenewright.stages.fuse.merging import Merging, SharedSegment
from scenewright.stages.fuse.parameters import FuseParameters
from scenewright.stages.fuse.regularization import MergedLabels
from scenewright.stages.fuse.voxel_blocks import COORDINATE_LIMIT, SIDE, VoxelBlocks


class PanopticMapper:
    """Voxel blocks, segment labels and how often they were seen; `merging` decides what is one."""

    def __init__(self, parameters: FuseParameters, merging: Merging) -> None:
        self.parameters = parameters
        self.merging = merging
        self.blocks = VoxelBlocks(parameters.voxel_size)
        self.labels = MergedLabels()
        self.sightings: dict[int, int] = {}
        """Frame segments that each segment label was matched to, predicted or background."""
        self.seen_in: dict[int, int] = {}
        """Frames in which each instance was predicted, as the bits of an integer."""
        self.free_space = FreeSpace() if parameters.merging == "ours" else None
        is_ours = parameters.merging == "ours"
        self.exposure = Exposure() if is_ours and parameters.exposure else None
        self.looks = Looks(parameters.voxel_size)
        self.cameras: list[np.ndarray] = []
        """Where the camera was at every frame (3,) [m]."""
        self.frames_integrated = 0
        self.labelled_frames = 0
        self.segment_merges = 0
        self.instance_merges = 0

    @property
    def truncation_distance(self) -> float:
        """Metres."""
        return self.parameters.truncation_voxels * self.parameters.voxel_size

    def held(self) -> PanopticMapper:
        """Return a mapper of the same voxels that can be closed without a trace in this one: closing merges labels.

        It shares the voxel blocks and is good until the next frame.
        """
        mapper = copy(self)
        mapper.labels, mapper.merging, mapper.looks = deepcopy(self.labels), deepcopy(self.merging), copy(self.looks)
        mapper.sightings, mapper.seen_in = dict(self.sightings), dict(self.seen_in)
        return mapper

    def add_frame(
        self,
        camera: Camera,
        depth: np.ndarray,
        color: np.ndarray | None,
        world_from_camera: np.ndarray,
        ids: np.ndarray | None = None,
        listing: Sequence[FrameSegment] = (),
        deviation: np.ndarray | None = None,
        camera_name: str = "",
    ) -> None:
        """Fuse one frame: depth (H, W) float32 [m], colour (H, W, 3) uint8 or None, world_from_camera (4, 4), deviation
        of depth (H, W) float32 [m] (0: unknown) or None. Cameras of a log are told apart by `camera_name`.

        ids (H, W) int32: the frame's panoptic image, whose values `listing` explains; None fuses geometry alone. Raises
        BadInput for images of different sizes, for an id that is not listed, and for a camera too far from the origin
        for the voxel grid.
        """
        options = self.parameters
        expected = (camera.height, camera.width)
        for name, image in (("depth", depth), ("colour", color), ("segments", ids), ("deviation", deviation)):
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
        if self.exposure is not None and color is not None:
            color = self.exposure.corrected(
                self.blocks, camera, camera_name, depth, color, world_from_camera, options.maximum_depth
            )
        index_image, frame_labels = None, np.zeros(1, dtype=np.int32)
        if ids is not None:
            index_image, frame_labels = self._associate(camera, depth, world_from_camera, ids, listing)
        integrate(
            self.blocks,
            depth,
            camera,
            world_from_camera,
            truncation=self.truncation_distance,
            near=options.minimum_depth,
            far=options.maximum_depth,
            deviation=deviation,
            color=color,
            index_image=index_image,
            label_of_index=frame_labels,
            canonical=self.labels.table(),
            maximum_weight=options.maximum_weight,
            label_band=options.label_band * self.truncation_distance,
            stride=options.block_stride,
        )
        if self.free_space is not None:
            self.free_space.add_frame(camera, depth, world_from_camera, options.maximum_depth)
        self.cameras.append(np.array(world_from_camera[:3, 3], float))
        self.frames_integrated += 1
        if self.frames_integrated % options.regularize_every == 0:
            self.regularize()
        for label in self.merging.forget_lost(self.sightings, self._labels_with_voxels):
            del self.sightings[label]

    def regularize(self) -> None:
        """Merge the instance labels that are one by now."""
        for removed, kept in self.merging.merge_instances():
            self.seen_in[kept] = self.seen_in.get(kept, 0) | self.seen_in.pop(removed, 0)
            self.instance_merges += 1

    def _labels_with_voxels(self) -> set[int]:
        table = self.labels.table()
        alive = np.zeros(len(table), dtype=bool)
        alive[self.blocks.segment[: self.blocks.count].ravel()] = True
        return set(table[alive].tolist())

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
        if options.merging == "ours":
            self.looks.add_frame(
                camera,
                depth,
                index_image,
                segments,
                world_from_camera,
                near=options.minimum_depth,
                far=options.maximum_depth,
            )
        overlap = measure_overlap(
            self.blocks,
            depth,
            index_image,
            len(segments),
            camera,
            world_from_camera,
            canonical=self.labels.table(),
            near=options.minimum_depth,
            far=options.maximum_depth,
            stride=options.overlap_stride,
        )
        matched = match_segments(
            overlap, minimum_voxels=options.minimum_overlap_voxels, minimum_share=options.minimum_overlap_share
        )
        labels = [self.labels.new() if label == 0 else max(label, 0) for label in matched]
        inside = overlapping_labels(overlap, options.merge_overlap_share)
        self.merging.observe_segments(
            [SharedSegment(segment.class_id, group) for group, segment in zip(inside, segments, strict=True)],
            [label for label in labels if label > 0],
        )
        self._predict(
            [
                Prediction(label, segment.class_id, segment.instance, segment.score)
                for label, segment in zip(labels, segments, strict=True)
                if label > 0 and segment.class_id > 0
            ],
            [label for label, segment in zip(labels, segments, strict=True) if label > 0 and segment.class_id == 0],
        )
        for label in labels:
            if label > 0:
                self.sightings[label] = self.sightings.get(label, 0) + 1
        merged = self.merging.merge_segments(self.labels)
        for removed, kept in merged:
            self.sightings[kept] = self.sightings.get(kept, 0) + self.sightings.pop(removed, 0)
        self.segment_merges += len(merged)
        return index_image, np.array([0, *(self.labels.root(label) for label in labels)], dtype=np.int32)

    def _predict(self, predictions: list[Prediction], unpredicted: list[int]) -> None:
        """Give every predicted instance its global label and remember the frame."""
        instances = self.merging.predict(predictions, unpredicted)
        for prediction in predictions:
            instance = instances.get((prediction.frame_instance, prediction.class_id), 0)  # 0: it bounds the room
            if instance:
                self.seen_in[instance] = self.seen_in.get(instance, 0) | (1 << self.labelled_frames)
        self.labelled_frames += 1
