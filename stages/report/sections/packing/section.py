"""Declaration of the section `packing`."""

from __future__ import annotations

from scenewright.schemas.packing import Packing
from scenewright.stages.report.section import Section

SECTION = Section(
    "packing",
    "Packing",
    order=80,
    reads={"packing": Packing},
    became={"packing": "a packing of boxes"},
    alone="Boxes and a basket",
)
