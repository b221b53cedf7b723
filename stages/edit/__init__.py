"""What a person puts right, applied again whenever the artifact is made anew."""

from __future__ import annotations

from typing import TYPE_CHECKING

from scenewright.stages.kit.exports import exported

if TYPE_CHECKING:
    from scenewright.stages.edit.anchoring import Fitting, anchor_of, written_box
    from scenewright.stages.edit.applying import apply_edits
    from scenewright.stages.edit.map_edits import MAP_EDITS
    from scenewright.stages.edit.map_state import MapState, read_state
    from scenewright.stages.edit.parameters import EditMapParameters

__getattr__ = exported(__name__)
