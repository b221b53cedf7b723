"""The table of rules: its sums by hand, what its rules may say, and the fit on pairs whose answer is known."""

from __future__ import annotations

import numpy as np
import pytest
from scenewright.stages.segment.backends.objects.pairs import FEATURES
from scenewright.stages.segment.backends.objects.rules import (
    APART,
    CUT,
    OVER,
    RULES,
    START,
    TERMS,
    TOUCHING,
    UNDER,
    Rule,
    kind_of,
    rule_score,
    rule_table,
)
from scenewright.stages.segment.training.pair_rules.train import JOINS, choose_rules, fit_weights


def features(**values: float) -> np.ndarray:
    """Features of a pair, zero where nothing is said."""
    row = np.zeros(len(FEATURES), np.float32)
    for name, value in values.items():
        row[FEATURES.index(name)] = value
    return row


def test_a_score_is_the_sum_of_what_is_over_and_under_the_bounds() -> None:
    rules = (
        Rule(TOUCHING, "histogram", UNDER, 0.5, -4.0),
        Rule(TOUCHING, "broad_convex", OVER, 0.1, 10.0),
        Rule(APART, "histogram", UNDER, 0.5, -100.0),
    )
    table = rule_table(rules, {CUT: 7.0, TOUCHING: 1.0, APART: -1.0})
    # A border of a quarter of the smaller outline counts half: 0.8 x 0.5 x 0.5 = 0.2.
    pair = features(touching=1, histogram=0.25, connected=0.8, convex=0.5, border_share=0.25)
    assert rule_score(pair, table) == pytest.approx(1.0 - 4.0 * 0.25 + 10.0 * 0.1)
    assert rule_score(features(touching=1, histogram=0.75), table) == pytest.approx(1.0)
    assert rule_score(features(histogram=0.25), table) == pytest.approx(-1.0 - 25.0)
    assert rule_score(features(touching=1, cut=1.0), table) == pytest.approx(7.0)
    assert [kind_of(features(touching=1, cut=1)), kind_of(features(touching=1)), kind_of(features())] == [0, 1, 2]


def test_rules_speak_for_one_object_or_against_it_as_their_terms_do() -> None:
    assert set(START) == {CUT, TOUCHING, APART}
    for rule in RULES:
        assert rule.term in TERMS
        assert rule.weight * rule.side * JOINS[rule.term] > 0, rule


def test_parts_with_the_table_between_them_are_not_joined() -> None:
    table = rule_table(RULES, START)
    # Two ends of a box of like colour behind something that hides its middle.
    alike = {"histogram": 0.9, "hidden": 0.4, "extent": 0.05, "joint_residual": 0.3}
    assert rule_score(features(**alike), table) > 0
    assert rule_score(features(**(alike | {"hidden": 0.0, "behind": 0.4, "behind_gain": 0.4})), table) < 0


def test_a_fit_without_columns_is_the_logarithm_of_the_odds() -> None:
    answers, weights = np.array([1.0, 1.0, 0.0]), np.array([1.0, 2.0, 6.0])
    found = fit_weights(np.ones((3, 1)), answers, weights, np.zeros(0), np.zeros(1))
    assert found == pytest.approx([np.log(3 / 6)], abs=1e-4)


def test_a_weight_keeps_the_sign_it_is_given() -> None:
    random = np.random.default_rng(0)
    column = random.random(400)
    columns, answers = np.stack([np.ones(400), column], axis=1), (column + 0.3 * random.random(400) > 0.6).astype(float)
    right = fit_weights(columns, answers, np.ones(400), np.array([1]), np.zeros(2))
    wrong = fit_weights(columns, answers, np.ones(400), np.array([-1]), np.zeros(2))
    assert right[1] > 1
    assert wrong[1] == pytest.approx(0, abs=1e-6)


def test_the_first_rule_chosen_is_the_one_that_decides() -> None:
    random = np.random.default_rng(1)
    values = random.random((600, len(TERMS)))
    answers = (values[:, TERMS.index("histogram")] + 0.1 * random.normal(size=600) > 0.5).astype(float)
    rules, _ = choose_rules(APART, values, answers, np.ones(600))

    def spread(rule: Rule) -> float:
        excess = np.maximum(0, rule.side * (values[:, TERMS.index(rule.term)] - rule.bound))
        return abs(rule.weight) * float(excess.std())

    assert max(rules, key=spread).term == "histogram"
    assert all(rule.weight * rule.side * JOINS[rule.term] > 0 for rule in rules)
