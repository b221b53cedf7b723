"""The arms: which options of `segment`, `fuse` and `graph` stand for whom, and the cases they are measured in.

What the arms share is not theirs to win by: frames, masks, voxel size, integrator, and the geometric segments. The
published constants of the geometric segmentation (no smoothing, dense normals of 13 pixels, one-sided convexity) fail
on this sensor's noise, so that every arm gets ours, which helps the rivals (docs/results/mapping.md).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from scenewright.stages.fuse import FuseParameters
from scenewright.stages.graph import GraphParameters
from scenewright.stages.segment import SegmentParameters

LEVELS = {"clean": 0.0, "low": 0.15, "middle": 0.3, "high": 0.5}
"""Corruption of the true masks by case (stages/segment/backends/ground_truth/corruption.py)."""
LASTING = "lasting"
LASTING_CASES = {LASTING: "detector", "lasting/network": "network"}
"""Errors that last (stages/segment/backends/ground_truth/lasting.py): whose rates, by case; first the headline."""
BENT = "lasting/bent"
"""The errors of the first, and depth with bias, bending and colour beside it (depth_faults.py)."""
NETWORK = "network"
DRIFTING = "lasting/drifting"
"""The errors of the headline, poses that drift (drift.py)."""
ESTIMATED = "lasting/estimated"
"""The errors of the headline, poses that `poses` estimates (estimated.py)."""
CASES = (*LASTING_CASES, BENT, DRIFTING, ESTIMATED, *LEVELS, NETWORK)

SHOWN = LASTING
"""The case that the tables by room and class show; all arms run in it."""
EVERYWHERE = frozenset({"voxblox++", "thesis_separate", "thesis", "thesis_chosen", "ours"})
"""The arms that run in every case."""


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


def settings(arm: Arm) -> dict[str, object]:
    """Return what an arm sets, as plain values."""
    return {name: getattr(arm, name).model_dump(mode="json") for name in ("segment", "fuse", "graph")}
