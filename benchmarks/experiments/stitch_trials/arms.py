"""The arms of the suture trials: those of `suture simulate`, and those that exchange one mechanism."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from stages.suture.trials.ours.pose_correction import BySeenEnds, latest
from stages.suture.trials.policies import OURS, POLICIES, THESIS
from stages.suture.trials.thesis.extraction import NoSweep
from stages.suture.trials.thesis.handover import NormalUnchanged

ARMS = {
    **POLICIES,
    "ours_thesis_eyes": replace(OURS, perception="thesis"),
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
