"""Ours: pulls, stackings and grasps chosen together for the whole table, as far as physics bears it."""

from __future__ import annotations

from scenewright.stages.tableware.planning.joint import JointPolicy
from scenewright.stages.tableware.planning.policy import DeclaredPolicy
from scenewright.stages.tableware.planning.rules import Rules

RIVALS = ("pull", "stack")
_BOWLS = ("b", "bb", "bc", "bcc", "bbc")
_PAIRS = frozenset(
    {("u", "u"), ("c", "c"), ("c", "cc"), ("cc", "cc"), ("b", "bbb"), ("bb", "bbb"), ("bbb", "bc")}
    | {(lower, higher) for lower in _BOWLS for higher in _BOWLS if lower <= higher}
)
RULES = Rules(most_utensils=2, plates_alone=True, beside=_PAIRS, steady_pulls=True)
"""What physics bears (docs/TIDY.md): two utensils a pile, plates alone, and side by side the pairs of piles that came
whole in every grasp measured when the rule was made. Since utensils are pressed harder, of two cups side by side one
grasp in ten left one behind. What is pulled must bear it (pulled_load.py).
Dishes that carry utensils are lifted side by side as they stand only where the world's
chances say that nothing spills."""
POLICY = DeclaredPolicy(JointPolicy, RULES, rivals=RIVALS)
