"""Declaration of the section `cad`."""

from __future__ import annotations

from scenewright.schemas.cad_library import CadLibrary
from scenewright.schemas.cad_scene import CadScene
from scenewright.stages.report.section import Section

SECTION = Section(
    "cad",
    "CAD scene",
    order=50,
    reads={"cad_scene": CadScene, "cad_library": CadLibrary},
    became={"cad_scene": "a scene of CAD models"},
)
