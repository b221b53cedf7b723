"""What a trial came to, as the record that artifacts and benchmarks keep."""

from __future__ import annotations

from scenewright.schemas.suture_trial import SutureRun
from scenewright.stages.suture.trials.machine import Outcome


def run_of(arm: str, seed: int, outcome: Outcome) -> SutureRun:
    """Return the record of a trial."""
    return SutureRun(
        arm=arm,
        seed=seed,
        sutures=outcome.sutures,
        sutures_neutral=outcome.sutures_neutral,
        attempts=outcome.attempts,
        seconds=round(outcome.seconds, 3),
        errors="".join(kind for kind, _ in outcome.errors),
        reasons=tuple(reason for _, reason in outcome.errors),
        error_sutures=tuple(suture for suture, _ in outcome.error_places),
        error_seconds=tuple(round(seconds, 3) for _, seconds in outcome.error_places),
        interventions=outcome.interventions,
        looks=outcome.looks,
        right=outcome.right,
        abstained=outcome.abstained,
        stopped_short=outcome.stopped_short,
        thread_length=round(outcome.thread_length, 4),
    )
