"""Step `urdf`: the functionally equivalent scene as a kinematic tree for simulators and robots."""

from __future__ import annotations

from typing import TYPE_CHECKING

from scenewright.stages.kit.exports import exported

if TYPE_CHECKING:
    from scenewright.stages.urdf.mujoco_settle import mujoco_motions
    from scenewright.stages.urdf.scene_penetration import resting_overlaps
    from scenewright.stages.urdf.settle_report import COLLISION_DEPTH

__getattr__ = exported(__name__)
