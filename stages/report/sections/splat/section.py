"""Declaration of the section `splat`."""

from __future__ import annotations

from scenewright.schemas.splat import SplatViews
from scenewright.stages.report.section import Section

SECTION = Section(
    "splat",
    "Splat",
    order=35,
    reads={"splat_views": SplatViews},
    became={"splat_views": "Gaussians beside pictures"},
    alone="A room as Gaussians",
)
