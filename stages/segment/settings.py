"""The constants of the algorithms, out of the options of the step."""

from __future__ import annotations

from scenewright.stages.segment.fusion import FusionSettings
from scenewright.stages.segment.geometric import GeometricSettings
from scenewright.stages.segment.parameters import SegmentParameters


def geometric_settings(parameters: SegmentParameters) -> GeometricSettings:
    """Return the constants of the geometric segmentation."""
    return GeometricSettings(
        grid_columns=parameters.grid_columns,
        smoothing_window=parameters.smoothing_window,
        smoothing_deviation=parameters.smoothing_deviation,
        normal_window=parameters.normal_window,
        normal_step=parameters.normal_step,
        normal_distance_factor=parameters.normal_distance_factor,
        convexity_window=parameters.convexity_window,
        convexity_threshold=parameters.convexity_threshold,
        convexity_mask_threshold=parameters.convexity_mask_threshold,
        mutual_convexity=parameters.mutual_convexity,
        discontinuity_ratio=parameters.discontinuity_ratio,
        discontinuity_window=parameters.discontinuity_window,
        opening=parameters.opening,
        closing=parameters.closing,
        minimum_pixels=parameters.geometric_minimum,
    )


def fusion_settings(parameters: SegmentParameters) -> FusionSettings:
    """Return the constants of the fusion."""
    return FusionSettings(
        minimum_pixels=parameters.fusion_minimum,
        contained_share=parameters.contained_share,
        largest_part=parameters.largest_part,
        majority_share=parameters.majority_share,
        cluster_distance=parameters.cluster_distance,
        cluster_step=parameters.cluster_step,
        small_object_pixels=parameters.small_object_pixels,
    )
