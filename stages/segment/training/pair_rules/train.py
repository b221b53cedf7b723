"""Fit the table of rules by which `segment --backend objects --grouping rules` tells which patches are one object.

    scenewright train pair-rules --data FOLDER --out FOLDER [--quick]

Pairs come from where those of the trees come from (tabletop_pairs/): generated tabletops, seeds 0 up, and mOSD's
`learn` frames; never `test`. They are recorded with grouping by the truth, by rules set by hand, and twice by the rules
fitted before. For each kind of pair rules are chosen one by one, that with the largest score statistic first, and all
weights are fitted anew after each (logistic regression); the sign of every weight is given (JOINS). Says the table
for stages/segment/backends/objects/rules.py, and five-fold cross-validation over `learn`; writes both to `rules.json`.
"""

from __future__ import annotations

import json
import logging
from collections.abc import Iterable
from pathlib import Path

import numpy as np
from scenewright.stages.kit.formats.mosd_frames import CAMERA, FOLDER, LabelledFrame, read_frames
from scenewright.stages.kit.measurement.object_masks import score_object_masks
from scenewright.stages.segment.backends.objects.grouping import by_rules
from scenewright.stages.segment.backends.objects.rules import (
    APART,
    CUT,
    OVER,
    TERMS,
    TOUCHING,
    UNDER,
    Rule,
    kind_of,
    rule_table,
    term_values,
)
from scenewright.stages.segment.backends.objects.segmentation import segment_objects
from scenewright.stages.segment.training.pair_rules import RulesTraining
from scenewright.stages.segment.training.tabletop_pairs.pair_recording import pairs_of_frame
from scenewright.stages.segment.training.tabletop_pairs.train import FOLDS, GENERATED, GENERATED_QUICK, generated_frames
from scipy.optimize import minimize

_LOGGER = logging.getLogger("scenewright")
JOINS = {
    "histogram": 1,
    "hidden": 1,
    "convexity": 1,
    "cosine": 1,
    "normal_angle": 1,
    "height_overlap": 1,
    "border_share": 1,
    "connected": 1,
    "enclosed": 1,
    "broad_convex": 1,
    "convex": 1,
    "chroma": -1,
    "lightness": -1,
    "border_color": -1,
    "border_color_steps": -1,
    "broad_color": -1,
    "fine_steps": -1,
    "behind": -1,
    "behind_gain": -1,
    "missing": -1,
    "extent": -1,
    "top_difference": -1,
    "bottom_difference": -1,
    "lowest": -1,
    "higher_bottom": -1,
    "residual_gain": -1,
    "joint_residual": -1,
    "rise": -1,
    "concave": -1,
    "jump": -1,
    "nearer": -1,
    "gap": -1,
    "smaller_pixels": -1,
}
"""1: more of it can only speak for one object; -1: only against. Small groups join their neighbours."""
ON_A_BORDER = ("border_color", "border_color_steps", "fine_steps", "border_share", "cosine", "convexity", "rise")
ON_ANY_BORDER = ("convex", "concave", "broad_convex", "broad_color", "connected", "nearer", "jump")
"""Terms that only pairs with a common border have; the second ones say nothing of a cut."""
MOST = {CUT: 8, TOUCHING: 14, APART: 10}
"""Rules of each kind of pair."""
QUANTILES = (0.0, 0.1, 0.3, 0.5, 0.7, 0.9)
"""Bounds are sought there."""
REAL_WEIGHT = 8.0
"""Weight of a pair of a real frame, in pairs of generated ones. By eye."""
PAIRS = 60
"""A frame with more pairs weighs less than in proportion: by the root of this over their number."""
PENALTY = 2.0
"""Weight of the squared coefficients in the loss. By eye."""
BY_TRUTH = 0.3
"""Share of the joints that follow the truth from the second round on. By eye."""
ROUNDS = 3
"""Rounds that follow the rules learnt before, as DAgger does."""
BY_HAND = (
    (
        Rule(CUT, "histogram", OVER, 0.0, 4.0),
        Rule(CUT, "fine_steps", OVER, 0.0, -2.0),
        Rule(TOUCHING, "convex", OVER, 0.0, 3.0),
        Rule(TOUCHING, "concave", OVER, 0.0, -2.3),
        Rule(TOUCHING, "behind_gain", OVER, 0.0, -10.0),
        Rule(TOUCHING, "border_color", OVER, 0.0, -0.12),
        Rule(TOUCHING, "chroma", OVER, 0.0, -0.08),
        Rule(TOUCHING, "top_difference", OVER, 0.0, -8.0),
        Rule(APART, "hidden", OVER, 0.0, 12.0),
        Rule(APART, "behind_gain", OVER, 0.0, -6.0),
        Rule(APART, "top_difference", OVER, 0.0, -5.0),
    ),
    {CUT: 3.0, TOUCHING: 3.0, APART: -2.0},
)
KEPT = (Rule(CUT, "histogram", UNDER, 0.1, -30.0), Rule(APART, "behind_gain", OVER, 0.0, -30.0))
"""Set by hand and added to what is fitted: pieces that share no colour are two things, as flush boxes are, whatever
few pairs of the training data say; and only what something hides may be missing between two parts."""
Rows = tuple[np.ndarray, np.ndarray, np.ndarray]
"""Features (N, F), answers (N,) 0/1 and weights (N,) of pairs."""


def recorded(frames: Iterable[LabelledFrame], table: np.ndarray, by_truth: float, weight: float, seed: int) -> Rows:
    """Return the pairs that grouping by a table of rules meets, the share `by_truth` of the joints by the truth."""
    features, answers, weights = [], [], []
    for k, frame in enumerate(frames):
        recording = pairs_of_frame(frame, by_rules(table), by_truth, np.random.default_rng([seed, k]))
        known = recording.answers >= 0
        count = int(known.sum())
        features.append(recording.features[known])
        answers.append(recording.answers[known].astype(float))
        weights.append(np.full(count, weight * np.sqrt(PAIRS / max(count, 10))))
    return np.concatenate(features), np.concatenate(answers), np.concatenate(weights)


def joined(rows: Iterable[Rows]) -> Rows:
    """Return several recordings as one."""
    features, answers, weights = zip(*rows, strict=True)
    return np.concatenate(features), np.concatenate(answers), np.concatenate(weights)


def fit_weights(
    columns: np.ndarray, answers: np.ndarray, weights: np.ndarray, signs: np.ndarray, start: np.ndarray
) -> np.ndarray:
    """Return the coefficients (K,) of a logistic regression on columns (N, K), the first of ones; the others have the
    given signs (K - 1,) or are zero and are drawn to zero by PENALTY in units of their root mean square."""
    scale = np.sqrt((weights[:, None] * columns**2).sum(axis=0) / weights.sum())
    scaled = columns / scale

    def loss(coefficients: np.ndarray) -> tuple[float, np.ndarray]:
        z = scaled @ coefficients
        pull = np.concatenate([[0.0], coefficients[1:]])
        slope = weights * (1 / (1 + np.exp(-z)) - answers)
        value = float((weights * (np.logaddexp(0, z) - answers * z)).sum() + PENALTY * (pull**2).sum())
        return value, scaled.T @ slope + 2 * PENALTY * pull

    bounds = [(None, None), *((0, None) if sign > 0 else (None, 0) for sign in signs)]
    found = minimize(loss, start * scale, jac=True, method="L-BFGS-B", bounds=bounds, options={"maxiter": 200})
    return np.asarray(found.x / scale)


def choose_rules(kind: int, values: np.ndarray, answers: np.ndarray, weights: np.ndarray) -> tuple[list[Rule], float]:
    """Return the rules of one kind of pair and its starting score, from values (N, TERMS) of the terms."""
    candidates: list[tuple[str, int, float]] = []
    for term in JOINS:
        if (kind == APART and term in ON_A_BORDER) or (kind != TOUCHING and term in ON_ANY_BORDER):
            continue
        if kind != APART and term == "gap":
            continue
        bounds = np.unique(np.round(np.quantile(values[:, TERMS.index(term)], QUANTILES), 3))
        candidates += [(term, OVER, float(bound)) for bound in bounds]
        candidates += [(term, UNDER, float(bound)) for bound in bounds[1:]]
    excess = [np.maximum(0, side * (values[:, TERMS.index(term)] - bound)) for term, side, bound in candidates]
    kept = [k for k, column in enumerate(excess) if column.std() > 1e-9]
    candidates, hinges = [candidates[k] for k in kept], np.stack([excess[k] for k in kept], axis=1)
    signs = np.array([JOINS[term] * side for term, side, _ in candidates])
    hinges_scaled = hinges / np.sqrt((weights[:, None] * hinges**2).sum(axis=0) / weights.sum())
    chosen: list[int] = []
    columns = np.ones((len(values), 1))
    coefficients = fit_weights(columns, answers, weights, signs[:0], np.zeros(1))
    for _ in range(MOST[kind]):
        share = 1 / (1 + np.exp(-columns @ coefficients))
        slope, curvature = weights * (answers - share), weights * share * (1 - share)
        weighted = columns * curvature[:, None]
        normal = weighted.T @ columns + 1e-6 * np.eye(columns.shape[1])
        rest = hinges_scaled - columns @ np.linalg.solve(normal, weighted.T @ hinges_scaled)
        statistic = np.maximum(0, (slope @ rest) * signs) ** 2
        statistic /= np.maximum(curvature @ rest**2, 1e-3 * (curvature @ hinges_scaled**2) + 1e-9)
        statistic[chosen] = 0
        chosen.append(int(statistic.argmax()))
        columns = np.concatenate([columns, hinges[:, chosen[-1:]]], axis=1)
        coefficients = fit_weights(columns, answers, weights, signs[chosen], np.concatenate([coefficients, [0.0]]))
    rules = [
        Rule(kind, *candidates[k], float(f"{weight:.3g}"))
        for k, weight in zip(chosen, coefficients[1:], strict=True)
        if weight != 0
    ]
    return rules, float(f"{coefficients[0]:.3g}")


def fit(rows: Rows) -> tuple[tuple[Rule, ...], dict[int, float]]:
    """Return the table of rules for pairs of all kinds."""
    features, answers, weights = rows
    kinds = np.array([kind_of(row) for row in features])
    values = np.array([term_values(row) for row in features])
    rules: list[Rule] = []
    start: dict[int, float] = {}
    for kind in (CUT, TOUCHING, APART):
        own = kinds == kind
        some, start[kind] = choose_rules(kind, values[own], answers[own], weights[own])
        rules += sorted(some, key=lambda rule: (rule.term, rule.bound))
    return (*rules, *KEPT), start


def train(options: RulesTraining, out: Path) -> None:
    """Record, fit, validate, write."""
    frames = read_frames(options.data / FOLDER / "learn")
    count, folder = GENERATED_QUICK if options.quick else GENERATED, out / "tabletops"
    table = rule_table(*BY_HAND)
    generated, real = [], []
    for number in range(ROUNDS + 1):
        by_truth = BY_TRUTH if number else 1.0
        generated.append(recorded(generated_frames(count, folder), table, by_truth, 1.0, number))
        real.append(
            [recorded([frame], table, by_truth, REAL_WEIGHT, 1000 * number + k) for k, frame in enumerate(frames)]
        )
        # The first recording goes by the truth, the second by the rules set by hand.
        if number:
            rules, start = fit(joined([*generated, *(rows for recording in real for rows in recording)]))
            table = rule_table(rules, start)
    scores = []
    for fold in np.array_split(np.arange(len(frames)), FOLDS):
        seen = [rows for recording in real for k, rows in enumerate(recording) if k not in fold]
        scorer = by_rules(rule_table(*fit(joined([*generated, *seen]))))
        for k in fold:
            found = segment_objects(frames[k].color, frames[k].depth, CAMERA, scorer).labels
            scores.append(score_object_masks(frames[k].objects, found))
    result = {
        "start": start,
        "rules": rules,
        "overlap_f": float(np.mean([score.overlap.f for score in scores])),
        "boundary_f": float(np.mean([score.boundary.f for score in scores])),
        "right_count": float(np.mean([score.right_count for score in scores])),
    }
    (out / "rules.json").write_text(json.dumps(result, indent=2) + "\n")
    for line in (start, *rules, {name: value for name, value in result.items() if name not in ("start", "rules")}):
        _LOGGER.info("%s", line)
