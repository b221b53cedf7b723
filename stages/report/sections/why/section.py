"""Declaration of the section `why`."""

from __future__ import annotations

from scenewright.schemas.cad_scene import CadScene
from scenewright.schemas.contact_graph import ContactGraph
from scenewright.schemas.interactive_scene import InteractiveScene
from scenewright.schemas.panoptic_map import PanopticMap
from scenewright.stages.report.section import Section

SECTION = Section(
    "why",
    "Why it is so",
    order=65,
    reads={
        "panoptic_map": PanopticMap,
        "contact_graph": ContactGraph,
        "cad_scene": CadScene,
        "interactive_scene": InteractiveScene,
    },
)
