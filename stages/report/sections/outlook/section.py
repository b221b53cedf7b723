"""Declaration of the section `outlook`."""

from __future__ import annotations

from schemas.cad_scene import CadScene
from schemas.interactive_scene import InteractiveScene
from schemas.panoptic_map import PanopticMap
from stages.report.section import Section

SECTION = Section(
    "outlook",
    "What to trust",
    order=1,
    reads={"panoptic_map": PanopticMap, "cad_scene": CadScene, "interactive_scene": InteractiveScene},
)
