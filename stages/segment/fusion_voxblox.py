"""The fusion of Voxblox++ (Grinvald 2019): every geometric segment takes one mask; masks that none follows are lost."""

from __future__ import annotations

import numpy as np
from scenewright.stages.segment.fusion import FusedFrame, FusionSettings, describe, majority_labels
from scenewright.stages.segment.panoptic import PanopticFrame


def fuse(
    geometric: np.ndarray,
    panoptic: PanopticFrame,
    points: np.ndarray,
    settings: FusionSettings,
    small: np.ndarray | None = None,
) -> FusedFrame:
    """Return the fused segments of a frame: neither split nor clustered (`FusionRule`)."""
    owner = majority_labels(geometric, panoptic.ids, majority_share=settings.majority_share)
    return describe(geometric, owner, panoptic)
