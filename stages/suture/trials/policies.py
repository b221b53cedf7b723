"""The arms of the trials: the thesis's, and ours."""

from __future__ import annotations

from dataclasses import replace

from scenewright.stages.suture.motion.constants import INTERVENTIONS
from scenewright.stages.suture.trials.ours.coordination import BothAtOnce
from scenewright.stages.suture.trials.ours.extraction import AsInserted, OnTheWire
from scenewright.stages.suture.trials.ours.handover import TurnedAboutHolder
from scenewright.stages.suture.trials.ours.pose_correction import BySeenEnds
from scenewright.stages.suture.trials.ours.thread_handling import ByTheBooks, PullsOn, PushedSideways
from scenewright.stages.suture.trials.ours.trust import InPlace
from scenewright.stages.suture.trials.policy import Policy
from scenewright.stages.suture.trials.thesis.coordination import OneAtATime
from scenewright.stages.suture.trials.thesis.extraction import (
    ByTheEnds,
    LinearPull,
    NoSweep,
    NothingExpected,
    NotWatched,
    OverTheWound,
    ToCinchLength,
)
from scenewright.stages.suture.trials.thesis.handover import NormalChanged, ThreadAsItHangs
from scenewright.stages.suture.trials.thesis.pose_correction import NinetyDegrees, NoCorrection
from scenewright.stages.suture.trials.thesis.trust import EveryEstimate

THESIS = Policy(
    name="thesis",
    perception="thesis",
    trust=EveryEstimate(),
    coordination=OneAtATime(),
    pose_correction=NinetyDegrees(),
    sweep=OverTheWound(),
    expectation=NothingExpected(),
    grasp=ByTheEnds(),
    cinch=ToCinchLength(),
    slack_watch=NotWatched(),
    handover_thread=ThreadAsItHangs(),
    handover_test=NormalChanged(),
)
THREAD_HANDLING = replace(THESIS, name="thread_handling", pose_correction=NoCorrection())
OURS = Policy(
    name="ours",
    perception="ours",
    trust=InPlace(),
    coordination=BothAtOnce(),
    pose_correction=BySeenEnds(),
    sweep=OverTheWound(),
    expectation=AsInserted(),
    grasp=OnTheWire(),
    cinch=ByTheBooks(),
    slack_watch=PullsOn(),
    handover_thread=PushedSideways(),
    handover_test=TurnedAboutHolder(),
)
POLICIES = {
    "sensing_only": replace(THREAD_HANDLING, name="sensing_only", sweep=NoSweep(), cinch=LinearPull()),
    "thread_handling": THREAD_HANDLING,
    "thesis": THESIS,
    "thesis_supervised": replace(THESIS, name="thesis_supervised", interventions=INTERVENTIONS),
    "ours": OURS,
    "ours_supervised": replace(OURS, name="ours_supervised", interventions=INTERVENTIONS),
}
