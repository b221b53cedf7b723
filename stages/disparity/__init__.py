"""The step `disparity`: depth from the stereo pairs of a sequence."""

from __future__ import annotations

from typing import TYPE_CHECKING

from scenewright.stages.kit.exports import exported

if TYPE_CHECKING:
    from scenewright.stages.disparity.parameters import DisparityParameters
    from scenewright.stages.disparity.raft.checkpoint import load_network
    from scenewright.stages.disparity.raft.matching import SMALL_UPDATES, moved_right, open_raft
    from scenewright.stages.disparity.rectification import matched_features
    from scenewright.stages.disparity.semi_global import SemiGlobalSettings, gray_of, match

_MODULES = {
    "DisparityParameters": "scenewright.stages.disparity.parameters",
    "load_network": "scenewright.stages.disparity.raft.checkpoint",
    "SMALL_UPDATES": "scenewright.stages.disparity.raft.matching",
    "moved_right": "scenewright.stages.disparity.raft.matching",
    "open_raft": "scenewright.stages.disparity.raft.matching",
    "matched_features": "scenewright.stages.disparity.rectification",
    "SemiGlobalSettings": "scenewright.stages.disparity.semi_global",
    "gray_of": "scenewright.stages.disparity.semi_global",
    "match": "scenewright.stages.disparity.semi_global",
}

__getattr__ = exported(__name__, _MODULES)
