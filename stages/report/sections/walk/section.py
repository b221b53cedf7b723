"""Declaration of the section `walk`."""

from __future__ import annotations

from scenewright.schemas.cad_scene import CadScene
from scenewright.schemas.contact_graph import ContactGraph
from scenewright.schemas.interactive_scene import InteractiveScene
from scenewright.schemas.panoptic_map import PanopticMap
from scenewright.stages.report.section import Section

SECTION = Section(
    "walk",
    "Walk in",
    order=2,
    reads={
        "panoptic_map": PanopticMap,
        "contact_graph": ContactGraph,
        "cad_scene": CadScene,
        "interactive_scene": InteractiveScene,
    },
)
