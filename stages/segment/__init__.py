"""Per-frame segmentation: geometric segments of the depth, panoptic segments of a backend, and their fusion."""

from __future__ import annotations

from typing import TYPE_CHECKING

from scenewright.stages.kit.exports import exported

if TYPE_CHECKING:
    from scenewright.stages.segment.backends.detector.yolox import Detector
    from scenewright.stages.segment.backends.network.backend import Predictor, load_predictor
    from scenewright.stages.segment.backends.network.features import input_camera, mount_of_pose, resized
    from scenewright.stages.segment.backends.objects.boosting import read_trees
    from scenewright.stages.segment.backends.objects.grouping import by_trees
    from scenewright.stages.segment.backends.objects.plain import segment_plain
    from scenewright.stages.segment.backends.objects.segmentation import segment_objects
    from scenewright.stages.segment.choice import BackendRequest, choose_backend
    from scenewright.stages.segment.fusion import FusionSettings
    from scenewright.stages.segment.fusion_ours import fuse
    from scenewright.stages.segment.geometric import (
        GeometricFrame,
        GeometricSettings,
        depth_discontinuity,
        edge_map,
        label_regions,
        minimum_convexity,
        segment_depth,
        smooth_depth,
    )
    from scenewright.stages.segment.normals import surface_normals
    from scenewright.stages.segment.panoptic import PanopticFrame, PanopticMask
    from scenewright.stages.segment.parameters import SegmentParameters
    from scenewright.stages.segment.registry import all_backends
    from scenewright.stages.segment.settings import fusion_settings, geometric_settings
    from scenewright.stages.segment.training.network.shards import Sample, write_shard

__getattr__ = exported(__name__)
