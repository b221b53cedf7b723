"""Declaration of the section `walk`."""

from __future__ import annotations

from schemas.cad_scene import CadScene
from schemas.contact_graph import ContactGraph
from schemas.interactive_scene import InteractiveScene
from schemas.panoptic_map import PanopticMap
from stages.report.section import Section

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
