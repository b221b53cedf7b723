"""Declaration of the section `cutting`."""

from __future__ import annotations

from scenewright.schemas.cutting_plan import CuttingPlan, CuttingTrial
from scenewright.stages.report.section import Section

SECTION = Section(
    "cutting",
    "Cutting",
    order=87,
    reads={"cutting_plan": CuttingPlan, "cutting_trial": CuttingTrial},
    became={"cutting_plan": "a plan of cuts", "cutting_trial": "a trial of cutting"},
    alone="Things cut into fragments",
)
