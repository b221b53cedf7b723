"""The arms of the suture trials: those of `suture simulate`, those that exchange one mechanism, and changed eyes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from scenewright.stages.suture import OURS, POLICIES, THESIS, BySeenEnds, NormalUnchanged, NoSweep, PerceptionModel
from scenewright.stages.suture.trials.ours.pose_correction import latest
from scenewright.stages.suture.trials.perception import FOLDER, Shares

ARMS = {
    **POLICIES,
    "ours_thesis_eyes": replace(OURS, perception="thesis"),
    "ours_thesis_eyes_supervised": replace(POLICIES["ours_supervised"], perception="thesis"),
    "ours_one_at_a_time": replace(OURS, coordination=THESIS.coordination),
    "ours_network_eyes": OURS,
    "thesis_other_test": replace(THESIS, handover_test=NormalUnchanged()),
}
"""By the names that metrics keep."""
NETWORK_EYES = Path(__file__).resolve().parents[2] / "stitch" / "perception_ours_network.toml"
"""The error model by which `ours_network_eyes` sees: ours from the network's masks, its time counted."""
WITHOUT = {
    "ours_without_servoes_ends": replace(OURS, pose_correction=THESIS.pose_correction),
    "ours_without_keeps_books": replace(OURS, cinch=THESIS.cinch),
    "ours_without_cinches_before_handover": replace(OURS, handover_thread=THESIS.handover_thread),
    "ours_without_checks_place": replace(OURS, trust=THESIS.trust),
    "ours_without_centres_jaws": replace(OURS, grasp=THESIS.grasp),
    "ours_without_expects": replace(OURS, expectation=THESIS.expectation),
    "ours_without_watches_slack": replace(OURS, slack_watch=THESIS.slack_watch),
    "ours_without_fuses_looks": replace(OURS, pose_correction=BySeenEnds(combined=latest)),
    "ours_without_checks_turn": replace(OURS, handover_test=THESIS.handover_test),
    "ours_without_sweeps": replace(OURS, sweep=NoSweep()),
}
"""Ours, one mechanism at a time as in the thesis (or left out)."""


def _shares(shares: Shares, change: Callable[[float], float]) -> Shares:
    return Shares(**{place: change(share) for place, share in shares.model_dump().items()})


def _ends(model: PerceptionModel, times: float) -> PerceptionModel:
    errors = (model.right, model.wrong)
    right, wrong = (e.model_copy(update={"end_millimetres": times * e.end_millimetres}) for e in errors)
    return model.model_copy(update={"right": right, "wrong": wrong})


def _with(**values: float) -> Callable[[PerceptionModel], PerceptionModel]:
    return lambda model: model.model_copy(update=values)


CHANGES: dict[str, Callable[[PerceptionModel], PerceptionModel]] = {
    "not_right_twice": lambda model: model.model_copy(
        update={"right_share": _shares(model.right_share, lambda share: max(0.0, 2.0 * share - 1.0))}
    ),
    "never_abstains": lambda model: model.model_copy(
        update={"abstained_share": _shares(model.abstained_share, lambda share: 0.0)}
    ),
    "fate_stays": _with(persistence=0.9),
    "error_stays": _with(systematic=1.0),
    "ends_1.5": lambda model: _ends(model, 1.5),
    "ends_2": lambda model: _ends(model, 2.0),
    "thread_10": _with(thread_length_error=0.1),
    "slow": _with(seconds_an_estimate=0.5),
}
"""Case -> what of ours' error model is changed in it."""


def eyes_of(arm: str) -> Path:
    """Return the error model by which an arm sees, if none is given."""
    if arm == "ours_network_eyes":
        return NETWORK_EYES
    return FOLDER / f"perception_{(ARMS | WITHOUT)[arm].perception}.toml"
