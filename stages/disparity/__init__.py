"""The step `disparity`: depth from the stereo pairs of a sequence."""

from __future__ import annotations

from typing import TYPE_CHECKING

from scenewright.stages.kit.exports import exported

if TYPE_CHECKING:
    from scenewright.stages.disparity.consistency import deviation_of
    from scenewright.stages.disparity.parameters import DisparityParameters
    from scenewright.stages.disparity.raft.checkpoint import load_network
    from scenewright.stages.disparity.raft.matching import SMALL_UPDATES, moved_right, open_raft
    from scenewright.stages.disparity.rectification import matched_features
    from scenewright.stages.disparity.semi_global import SemiGlobalSettings, gray_of, match

__getattr__ = exported(__name__)
