"""Declaration of the section `suture`."""

from __future__ import annotations

from scenewright.schemas.suture_needle import SutureNeedle, SutureThread
from scenewright.schemas.suture_trial import SutureEvaluation, SutureTrial
from scenewright.stages.report.section import Section

SECTION = Section(
    "suture",
    "Suturing",
    order=100,
    reads={
        "suture_needle": SutureNeedle,
        "suture_thread": SutureThread,
        "suture_trial": SutureTrial,
        "suture_evaluation": SutureEvaluation,
    },
    became={
        "suture_needle": "a needle that was looked at",
        "suture_thread": "a thread that was traced",
        "suture_trial": "sutures thrown in a simulator",
        "suture_evaluation": "their figures",
    },
    alone="Suture throws",
)
