"""The arms of the suture trials: those of `suture simulate`, and those that exchange one mechanism."""

from __future__ import annotations

from dataclasses import replace

from stages.suture.trials.settings import POLICIES

ARMS = {
    **POLICIES,
    "ours_thesis_eyes": replace(POLICIES["ours"], perception="thesis"),
    "ours_one_at_a_time": replace(POLICIES["ours"], moves_both=False),
    "thesis_other_test": replace(POLICIES["thesis"], retries_when_unchanged=False),
}
"""By the names that metrics keep."""
MECHANISMS = (
    "servoes_ends", "keeps_books", "cinches_before_handover", "checks_place", "centres_jaws", "expects",
    "watches_slack", "fuses_looks", "checks_turn", "sweeps",
)  # fmt: skip
WITHOUT = {f"ours_without_{name}": replace(POLICIES["ours"], **{name: False}) for name in MECHANISMS}
"""Ours, one mechanism at a time as in the thesis (or left out)."""
