"""Plan what a robot does in a scene, execute it in physics, and say why when it cannot be done."""

from __future__ import annotations

from typing import TYPE_CHECKING

from scenewright.stages.kit.exports import exported

if TYPE_CHECKING:
    from scenewright.stages.plan.tasks import TaskName

__getattr__ = exported(__name__)
