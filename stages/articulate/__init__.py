"""Step `articulate`: doors and drawers seen in two states become joints."""

from __future__ import annotations

from typing import TYPE_CHECKING

from scenewright.stages.kit.exports import exported

if TYPE_CHECKING:
    from scenewright.stages.articulate.parameters import ArticulateParameters

__getattr__ = exported(__name__)
