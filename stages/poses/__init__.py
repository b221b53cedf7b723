"""Step `poses`: a trajectory for a log that has none."""

from __future__ import annotations

from typing import TYPE_CHECKING

from scenewright.stages.kit.exports import exported

if TYPE_CHECKING:
    from scenewright.stages.poses.world import laid_onto

__getattr__ = exported(__name__)
