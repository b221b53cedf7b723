"""Declaration of the section `figures`."""

from __future__ import annotations

from scenewright.schemas.evaluation import Evaluation
from scenewright.stages.report.section import Section

SECTION = Section("figures", "Figures", order=110, reads={"evaluation": Evaluation, "baseline_evaluation": Evaluation})
