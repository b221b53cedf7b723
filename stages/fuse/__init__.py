"""Step `fuse`: segmented frames become a panoptic map."""

from __future__ import annotations

from typing import TYPE_CHECKING

from scenewright.stages.kit.exports import exported

if TYPE_CHECKING:
    from scenewright.stages.fuse.integration import integrate
    from scenewright.stages.fuse.listings import Listings
    from scenewright.stages.fuse.mapping import PanopticMapper
    from scenewright.stages.fuse.ours import Ours
    from scenewright.stages.fuse.parameters import FuseParameters
    from scenewright.stages.fuse.smoothing import smoothed_tsdf
    from scenewright.stages.fuse.stage import new_mapper, write_map
    from scenewright.stages.fuse.surface import Surface, extract_surface
    from scenewright.stages.fuse.voxel_blocks import VoxelBlocks

__getattr__ = exported(__name__)
