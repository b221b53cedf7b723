"""Declaration of the section `outlook`."""

from __future__ import annotations

from scenewright.schemas.cad_scene import CadScene
from scenewright.schemas.interactive_scene import InteractiveScene
from scenewright.schemas.panoptic_map import PanopticMap
from scenewright.stages.report.section import Section

SECTION = Section(
    "outlook",
    "What to trust",
    order=1,
    reads={"panoptic_map": PanopticMap, "cad_scene": CadScene, "interactive_scene": InteractiveScene},
)
