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

_MODULES = {
    "Fitting": "scenewright.stages.edit.anchoring",
    "anchor_of": "scenewright.stages.edit.anchoring",
    "written_box": "scenewright.stages.edit.anchoring",
    "apply_edits": "scenewright.stages.edit.applying",
    "MAP_EDITS": "scenewright.stages.edit.map_edits",
    "MapState": "scenewright.stages.edit.map_state",
    "read_state": "scenewright.stages.edit.map_state",
    "EditMapParameters": "scenewright.stages.edit.parameters",
}

__getattr__ = exported(__name__, _MODULES)
