"""Whether two groups of patches are one object, by a short table of rules: geometry and colour, no learned trees.

Every rule adds `weight` for each unit by which a feature of the pair is over, or under, its `bound`; over 0 in all they
are one object. What a rule may say is set by hand: like colours, a convex border, a well-filled hull and something that
hides the gap can only join; other colours, background inside the hull, other heights and a large union can only part.
Which of these rules are in the table, their bounds and weights were fitted by `scenewright train pair-rules` on
generated tabletops and mOSD's `learn` frames; those marked with "by hand" were not.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scenewright.stages.kit.compiled import compiled
from scenewright.stages.segment.backends.objects.pairs import FEATURES

_AT = {name: k for k, name in enumerate(FEATURES)}
CONNECTED, CONVEX, SHARE, BORDER_COLOR = _AT["connected"], _AT["convex"], _AT["border_share"], _AT["border_color"]
"""Positions of the features that the broad terms are made of."""
JOINED_BY_CUT, TOUCHES = _AT["cut"], _AT["touching"]
"""Positions of the features that say of which kind a pair is."""
PLAIN = len(FEATURES)
"""Number of plain features; the broad terms follow them."""
TERMS = (*FEATURES, "broad_convex", "broad_color")
"""What rules speak of: the features of pairs.py; convex share and colour step of the border, in proportion to the
length of the border where that is under half of the smaller group's."""

CUT, TOUCHING, APART = 0, 1, 2
"""Kinds of pairs: pieces of one smooth patch, other neighbours, groups that do not touch."""
OVER, UNDER = 1, -1
"""Sides of its bound on which a feature counts."""


class Rule(NamedTuple):
    """One line of the table. Units are those of the feature: metres for heights and `extent`, shares 0..1."""

    kind: int
    term: str
    side: int
    bound: float
    weight: float


START = {CUT: 4.1, TOUCHING: -6.53, APART: -5.68}
"""The score before any rule."""
RULES = (
    Rule(CUT, "behind", UNDER, 0.085, 15.0),
    Rule(CUT, "border_share", OVER, 0.232, 4.04),
    Rule(CUT, "convexity", OVER, 0.024, 3.7),
    Rule(CUT, "cosine", OVER, 0.966, 55.2),
    Rule(CUT, "extent", OVER, 0.009, -43.3),
    Rule(CUT, "histogram", UNDER, 0.329, -15.3),
    Rule(CUT, "rise", UNDER, 0.009, 185.0),
    Rule(CUT, "top_difference", OVER, 0.0, -10.6),
    Rule(CUT, "histogram", UNDER, 0.1, -30.0),  # by hand: flush boxes that share no colour are two
    Rule(TOUCHING, "behind", UNDER, 0.037, 87.5),
    Rule(TOUCHING, "behind_gain", UNDER, 0.144, 19.3),
    Rule(TOUCHING, "border_color", UNDER, 23.734, 0.0124),
    Rule(TOUCHING, "broad_color", UNDER, 7.686, 0.349),
    Rule(TOUCHING, "broad_convex", UNDER, 0.178, -10.6),
    Rule(TOUCHING, "convexity", OVER, 0.0, 3.47),
    Rule(TOUCHING, "extent", UNDER, 0.125, 47.5),
    Rule(TOUCHING, "histogram", UNDER, 0.605, -5.26),
    Rule(TOUCHING, "lowest", UNDER, 0.006, 944.0),
    Rule(TOUCHING, "missing", UNDER, 0.073, 20.8),
    Rule(TOUCHING, "smaller_pixels", UNDER, 5.268, 3.87),
    Rule(TOUCHING, "top_difference", UNDER, 0.029, 154.0),
    Rule(TOUCHING, "top_difference", OVER, 0.072, -14.3),
    Rule(APART, "extent", UNDER, 0.13, 69.1),
    Rule(APART, "hidden", OVER, 0.264, 8.57),
    Rule(APART, "histogram", UNDER, 0.453, -5.86),
    Rule(APART, "joint_residual", UNDER, 4.46, 0.307),
    Rule(APART, "lowest", OVER, 0.156, -15.1),
    Rule(APART, "missing", UNDER, 0.033, 66.2),
    Rule(APART, "residual_gain", UNDER, 0.732, 1.02),
    Rule(APART, "top_difference", UNDER, 0.005, 639.0),
    Rule(APART, "top_difference", UNDER, 0.032, 45.9),
    Rule(APART, "behind_gain", OVER, 0.0, -30.0),  # by hand: only what something hides may be missing between two parts
)
"""The table; fitted by benchmarks/training/pair_rules.py but for what is marked "by hand"."""


def rule_table(rules: tuple[Rule, ...], start: dict[int, float]) -> np.ndarray:
    """Return rules and starting scores as rows (R, 5) float64 of kind, term (-1: none), side, bound, weight."""
    rows: list[tuple[float, ...]] = [(kind, -1, 0, 0, weight) for kind, weight in start.items()]
    rows += [(rule.kind, TERMS.index(rule.term), rule.side, rule.bound, rule.weight) for rule in rules]
    return np.array(rows, dtype=np.float64)


@compiled
def kind_of(f: np.ndarray) -> int:
    """Return CUT, TOUCHING or APART for the features (pairs.FEATURES) of a pair."""
    if f[JOINED_BY_CUT] > 0.5:
        return CUT
    return TOUCHING if f[TOUCHES] > 0.0 else APART


@compiled
def term_values(f: np.ndarray) -> np.ndarray:
    """Return the values (TERMS,) float64 that rules speak of, from the features (pairs.FEATURES) of a pair."""
    values = np.empty(PLAIN + 2)
    values[:PLAIN] = f
    length = min(1.0, 2.0 * f[SHARE])
    values[PLAIN] = f[CONNECTED] * f[CONVEX] * length
    values[PLAIN + 1] = f[BORDER_COLOR] * length
    return values


@compiled
def rule_score(f: np.ndarray, table: np.ndarray) -> float:
    """Return the score of two groups with features `f` (pairs.FEATURES) by the rows of rule_table."""
    kind, values, score = kind_of(f), term_values(f), 0.0
    for k in range(len(table)):
        if table[k, 0] != kind:
            continue
        term = int(table[k, 1])
        score += table[k, 4] if term < 0 else table[k, 4] * max(0.0, table[k, 2] * (values[term] - table[k, 3]))
    return score
