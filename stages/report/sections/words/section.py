"""Declaration of the section `words`."""

from __future__ import annotations

from scenewright.schemas.kitchen_plan import KitchenEvaluation, KitchenPlan
from scenewright.schemas.learned_domain import LearnedDomain
from scenewright.stages.report.section import Section

SECTION = Section(
    "words",
    "Words",
    order=86,
    reads={"learned": LearnedDomain, "kitchen_plan": KitchenPlan, "kitchen_evaluation": KitchenEvaluation},
    became={
        "learned": "predicates and operators",
        "kitchen_plan": "a goal in words, tried",
        "kitchen_evaluation": "sets of tasks, counted",
    },
    alone="What words mean",
)
