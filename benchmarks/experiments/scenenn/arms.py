"""The arms: which options of `segment`, `fuse` and `graph` stand for whom.

What the arms share is not theirs to win by: frames, masks, voxel size, integrator, and the geometric segments. The
published constants of the geometric segmentation (no smoothing, dense normals of 13 pixels, one-sided convexity) fail
on a structured-light sensor's noise, so that every arm gets ours, which helps the rivals.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from scenewright.stages.fuse import FuseParameters
from scenewright.stages.graph import GraphParameters
from scenewright.stages.segment import SegmentParameters


@dataclass(frozen=True)
class Arm:
    """One way from frames and masks to a map and boxes."""

    name: str
    title: str
    segment: SegmentParameters
    fuse: FuseParameters
    graph: GraphParameters


# What only `ours` does when surfaces become entities.
_PLAIN_EXTRACTION = {
    "label_band": 1.0,
    "smoothing": 0.0,
    "minimum_prediction_share": 0.0,
    "spread_steps": 0,
    "speck_share": 0.0,
    "piece_share": 0.0,
    "part_distance": 1000.0,
    "minimum_observations": 1,
    "minimum_overlap_share": 0.0,
}
_OUR_CHOICES = {
    name: value for name, value in _PLAIN_EXTRACTION.items() if name not in ("minimum_observations", "label_band")
}
"""... but for the two that any mapper can choose: observations that an entity takes, and the band of labels."""
_THESIS_CONSTANTS = {
    "truncation_voxels": 4.0,
    "maximum_depth": 4.0,
    "minimum_overlap_voxels": 8,
    "merge_overlap_share": 0.2,
    "merge_minimum_frames": 3,
}
_VOXBLOX_SCENENN = {
    "truncation_voxels": 5.0,
    "maximum_depth": 3.0,
    "minimum_overlap_voxels": 20,
    "merge_overlap_share": 0.1,
    "merge_minimum_frames": 2,
}
_VOXBLOX_DEFAULT = {**_VOXBLOX_SCENENN, "truncation_voxels": 3.0, "maximum_depth": 3.5}


def all_arms(voxel_size: float) -> tuple[Arm, ...]:
    """Return the arms in the order of the tables; all at one voxel size [m]."""

    def arm(name: str, title: str, segment: Mapping[str, object], fuse: Mapping[str, object], method: str) -> Arm:
        return Arm(
            name,
            title,
            SegmentParameters.model_validate(segment),
            FuseParameters.model_validate({"voxel_size": voxel_size, **fuse}),
            GraphParameters.model_validate({"method": method}),
        )

    voxblox = {"fusion": "voxblox++", "majority_share": 0.5}
    thesis = {"fusion": "thesis"}
    joint_only = {"merging": "thesis"}
    separate, joint = {**_PLAIN_EXTRACTION, "merging": "separate"}, {**_PLAIN_EXTRACTION, "merging": "thesis"}
    return (
        arm("voxblox++", "Voxblox++ (SceneNN constants)", voxblox, {**separate, **_VOXBLOX_SCENENN}, "thesis"),
        arm("voxblox++_default", "Voxblox++ (default constants)", voxblox, {**separate, **_VOXBLOX_DEFAULT}, "thesis"),
        arm("thesis_separate", "thesis without joint fusion", thesis, {**separate, **_THESIS_CONSTANTS}, "thesis"),
        arm("thesis", "thesis", thesis, {**joint, **_THESIS_CONSTANTS}, "thesis"),
        arm(
            "thesis_chosen",
            "thesis, our choices",
            thesis,
            {**_OUR_CHOICES, **joint_only, **_THESIS_CONSTANTS},
            "thesis",
        ),
        arm("ours", "ours", {}, {}, "ours"),
    )
