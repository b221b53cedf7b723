"""Declaration of the section `scene`."""

from __future__ import annotations

from scenewright.schemas.interactive_scene import InteractiveScene
from scenewright.stages.report.section import Section

SECTION = Section(
    "scene",
    "Interactive scene",
    order=60,
    reads={"interactive_scene": InteractiveScene},
    became={"interactive_scene": "a scene that simulators load"},
)
