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

_MODULES = {
    "Detector": "scenewright.stages.segment.backends.detector.yolox",
    "Predictor": "scenewright.stages.segment.backends.network.backend",
    "load_predictor": "scenewright.stages.segment.backends.network.backend",
    "input_camera": "scenewright.stages.segment.backends.network.features",
    "mount_of_pose": "scenewright.stages.segment.backends.network.features",
    "resized": "scenewright.stages.segment.backends.network.features",
    "read_trees": "scenewright.stages.segment.backends.objects.boosting",
    "by_trees": "scenewright.stages.segment.backends.objects.grouping",
    "segment_plain": "scenewright.stages.segment.backends.objects.plain",
    "segment_objects": "scenewright.stages.segment.backends.objects.segmentation",
    "BackendRequest": "scenewright.stages.segment.choice",
    "choose_backend": "scenewright.stages.segment.choice",
    "FusionSettings": "scenewright.stages.segment.fusion",
    "fuse": "scenewright.stages.segment.fusion_ours",
    "GeometricFrame": "scenewright.stages.segment.geometric",
    "GeometricSettings": "scenewright.stages.segment.geometric",
    "depth_discontinuity": "scenewright.stages.segment.geometric",
    "edge_map": "scenewright.stages.segment.geometric",
    "label_regions": "scenewright.stages.segment.geometric",
    "minimum_convexity": "scenewright.stages.segment.geometric",
    "segment_depth": "scenewright.stages.segment.geometric",
    "smooth_depth": "scenewright.stages.segment.geometric",
    "surface_normals": "scenewright.stages.segment.normals",
    "PanopticFrame": "scenewright.stages.segment.panoptic",
    "PanopticMask": "scenewright.stages.segment.panoptic",
    "SegmentParameters": "scenewright.stages.segment.parameters",
    "all_backends": "scenewright.stages.segment.registry",
    "fusion_settings": "scenewright.stages.segment.settings",
    "geometric_settings": "scenewright.stages.segment.settings",
    "Sample": "scenewright.stages.segment.training.network.shards",
    "write_shard": "scenewright.stages.segment.training.network.shards",
}

__getattr__ = exported(__name__, _MODULES)
