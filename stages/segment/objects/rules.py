"""Whether two groups of patches are one object, by a short table of rules: geometry and colour, no learned trees.

Every rule adds `weight` for each unit by which a feature of the pair is over, or under, its `bound`; over 0 in all they
are one object. What a rule may say is set by hand: like colours, a convex border, a well-filled hull and something that
hides the gap can only join; other colours, background inside the hull, other heights and a large union can only part.
Which of these rules are in the table, their bounds and weights were fitted by benchmarks/training/pair_rules.py on
generated tabletops and mOSD's `learn` frames; the one marked with "by hand" was not.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from stages.segment.objects.pairs import FEATURES

_AT = {name: k for k, name in enumerate(FEATURES)}
CONNECTED, CONVEX, SHARE, BORDER_COLOR = _AT["connected"], _AT["convex"], _AT["border_share"], _AT["border_color"]
JOINED_BY_CUT, TOUCHES = _AT["cut"], _AT["touching"]
PLAIN = len(FEATURES)
TERMS = (*FEATURES, "broad_convex", "broad_color")
"""What rules speak of: the features of pairs.py; convex share and colour step of the border, in proportion to the
length of the border where that is under half of the smaller group's."""

CUT, TOUCHING, APART = 0, 1, 2
"""Kinds of pairs: pieces of one smooth patch, other neighbours, groups that do not touch."""
OVER, UNDER = 1, -1


class Rule(NamedTuple):
    """One line of the table. Units are those of the feature: metres for heights and `extent`, shares 0..1."""

    kind: int
    term: str
    side: int
    bound: float
    weight: float


START = {CUT: 3.69, TOUCHING: -3.96, APART: -5.55}
"""The score before any rule."""
RULES = (
    Rule(CUT, "border_share", OVER, 0.234, 4.23),
    Rule(CUT, "cosine", OVER, 0.965, 52.4),
    Rule(CUT, "extent", OVER, 0.023, -51.0),
    Rule(CUT, "hidden", OVER, 0.024, 6.48),
    Rule(CUT, "histogram", UNDER, 0.335, -8.1),
    Rule(CUT, "histogram", UNDER, 0.619, -3.73),
    Rule(CUT, "top_difference", UNDER, 0.061, 36.3),
    Rule(TOUCHING, "behind", UNDER, 0.037, 86.4),
    Rule(TOUCHING, "behind_gain", UNDER, 0.078, 6.13),
    Rule(TOUCHING, "behind_gain", UNDER, 0.144, 14.6),
    Rule(TOUCHING, "border_color", UNDER, 23.8, 0.036),
    Rule(TOUCHING, "broad_color", UNDER, 7.55, 0.351),
    Rule(TOUCHING, "broad_convex", UNDER, 0.174, -12.7),
    Rule(TOUCHING, "convexity", OVER, 0.0, 3.88),
    Rule(TOUCHING, "extent", OVER, 0.074, -66.5),
    Rule(TOUCHING, "histogram", UNDER, 0.309, -8.23),
    Rule(TOUCHING, "lowest", UNDER, 0.006, 805.0),
    Rule(TOUCHING, "lowest", UNDER, 0.01, 77.7),
    Rule(TOUCHING, "smaller_pixels", UNDER, 7.32, 0.823),
    Rule(TOUCHING, "top_difference", UNDER, 0.029, 156.0),
    Rule(TOUCHING, "top_difference", OVER, 0.072, -19.7),
    Rule(APART, "behind_gain", OVER, 0.0, -20.0),  # by hand: only what something hides may be missing between two parts
    Rule(APART, "extent", UNDER, 0.13, 68.0),
    Rule(APART, "hidden", OVER, 0.256, 8.26),
    Rule(APART, "histogram", UNDER, 0.452, -6.09),
    Rule(APART, "joint_residual", UNDER, 4.43, 0.285),
    Rule(APART, "lowest", UNDER, 0.009, 140.0),
    Rule(APART, "lowest", OVER, 0.155, -14.1),
    Rule(APART, "missing", UNDER, 0.017, 140.0),
    Rule(APART, "residual_gain", UNDER, 0.749, 1.19),
    Rule(APART, "top_difference", UNDER, 0.005, 587.0),
    Rule(APART, "top_difference", UNDER, 0.032, 55.1),
)


def rule_table(rules: tuple[Rule, ...], start: dict[int, float]) -> np.ndarray:
    """Return rules and starting scores as rows (R, 5) float64 of kind, term (-1: none), side, bound, weight."""
    rows: list[tuple[float, ...]] = [(kind, -1, 0, 0, weight) for kind, weight in start.items()]
    rows += [(rule.kind, TERMS.index(rule.term), rule.side, rule.bound, rule.weight) for rule in rules]
    return np.array(rows, dtype=np.float64)


@njit(cache=True)
def kind_of(f: np.ndarray) -> int:
    """Return CUT, TOUCHING or APART for the features (pairs.FEATURES) of a pair."""
    if f[JOINED_BY_CUT] > 0.5:
        return CUT
    return TOUCHING if f[TOUCHES] > 0.0 else APART


@njit(cache=True)
def term_values(f: np.ndarray) -> np.ndarray:
    """Return the values (TERMS,) float64 that rules speak of, from the features (pairs.FEATURES) of a pair."""
    values = np.empty(PLAIN + 2)
    values[:PLAIN] = f
    length = min(1.0, 2.0 * f[SHARE])
    values[PLAIN] = f[CONNECTED] * f[CONVEX] * length
    values[PLAIN + 1] = f[BORDER_COLOR] * length
    return values


@njit(cache=True)
def rule_score(f: np.ndarray, table: np.ndarray) -> float:
    """Return the score of two groups with features `f` (pairs.FEATURES) by the rows of rule_table."""
    kind, values, score = kind_of(f), term_values(f), 0.0
    for k in range(len(table)):
        if table[k, 0] != kind:
            continue
        term = int(table[k, 1])
        score += table[k, 4] if term < 0 else table[k, 4] * max(0.0, table[k, 2] * (values[term] - table[k, 3]))
    return score
