"""Step `fuse`: segmented frames become a panoptic map."""

from __future__ import annotations

from typing import TYPE_CHECKING

from scenewright.stages.kit.exports import exported

if TYPE_CHECKING:
    from scenewright.stages.fuse.closing import MaskSource
    from scenewright.stages.fuse.integration import integrate
    from scenewright.stages.fuse.listings import Listings
    from scenewright.stages.fuse.mapping import PanopticMapper
    from scenewright.stages.fuse.ours import Ours
    from scenewright.stages.fuse.parameters import FuseParameters
    from scenewright.stages.fuse.smoothing import smoothed_tsdf
    from scenewright.stages.fuse.stage import new_mapper, write_map
    from scenewright.stages.fuse.surface import extract_surface
    from scenewright.stages.fuse.voxel_blocks import VoxelBlocks

_MODULES = {
    "MaskSource": "scenewright.stages.fuse.closing",
    "integrate": "scenewright.stages.fuse.integration",
    "Listings": "scenewright.stages.fuse.listings",
    "PanopticMapper": "scenewright.stages.fuse.mapping",
    "Ours": "scenewright.stages.fuse.ours",
    "FuseParameters": "scenewright.stages.fuse.parameters",
    "smoothed_tsdf": "scenewright.stages.fuse.smoothing",
    "new_mapper": "scenewright.stages.fuse.stage",
    "write_map": "scenewright.stages.fuse.stage",
    "extract_surface": "scenewright.stages.fuse.surface",
    "VoxelBlocks": "scenewright.stages.fuse.voxel_blocks",
}

__getattr__ = exported(__name__, _MODULES)
