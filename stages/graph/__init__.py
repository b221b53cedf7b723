"""Step `graph`: what stands on, leans on or hangs from what."""

from __future__ import annotations

from typing import TYPE_CHECKING

from scenewright.stages.kit.exports import exported

if TYPE_CHECKING:
    from scenewright.stages.graph.parameters import GraphParameters

__getattr__ = exported(__name__)
