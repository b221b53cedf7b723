"""Declaration of the section `map`."""

from __future__ import annotations

from scenewright.schemas.panoptic_map import PanopticMap
from scenewright.stages.report.section import Section

SECTION = Section(
    "map", "Map", order=30, reads={"panoptic_map": PanopticMap}, became={"panoptic_map": "a labelled map"}
)
