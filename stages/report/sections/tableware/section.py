"""Declaration of the section `tableware`."""

from __future__ import annotations

from scenewright.schemas.tableware_detections import TablewareDetections
from scenewright.schemas.tableware_plan import TablewarePlan
from scenewright.schemas.tableware_trial import TablewareEvaluation, TablewareTrial
from scenewright.stages.report.section import Section

SECTION = Section(
    "tableware",
    "Tableware",
    order=90,
    reads={
        "tableware_detections": TablewareDetections,
        "tableware_plan": TablewarePlan,
        "tableware_trial": TablewareTrial,
        "tableware_evaluation": TablewareEvaluation,
    },
    became={
        "tableware_detections": "a table that was looked at",
        "tableware_plan": "a plan to clear a table",
        "tableware_trial": "a table being cleared",
        "tableware_evaluation": "a comparison of policies",
    },
    alone="A table to clear",
)
