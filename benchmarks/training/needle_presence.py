"""The weights of the test whether there is a needle, by logistic regression on tuning views.

    python -m benchmarks stitch_absent --tuning --out RUN
    python -m benchmarks.training.needle_presence --run RUN

Prints the constants of stages/suture/needle/presence.py for views with pictures and for masks alone, and the errors by
leaving out blocks of seeds. The outline is a needle where there is one and the best guess is right; a wrong outline of
a needle is none. Of masks alone both kinds weigh the same; with pictures one that is none weighs as COST that are one.

The stored weights of PICTURED are of seeds 300 to 399, 5200 to 5247, 5300 to 5308 and 6000 to 6149: 248 right outlines
of needles, 14 of them with blood painted over the needle, 60 wrong ones, and 1,060 in 293 pictures of drapes at all of
the radii that are asked for there (the run above keeps that of the most tempting one).
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from pydantic import Field
from scenewright.stages.kit.stage import Parameters
from scenewright.stages.suture.needle.presence import FEATURES, PICTURED, capped
from scipy.optimize import minimize

from benchmarks.keeping import kept_records
from benchmarks.options import asked

FOLDS, COST = 10, 4.0
RIDGES = {False: 0.1, True: 0.001}
"""Of masks alone that of the least logarithmic loss, left out, of three; with pictures by eye. Shares of kinds sum to
their number of views there, and to one here."""


class Options(Parameters):
    """Options."""

    run: Path = Field(description="Folder of the tuning views")


def samples(run: Path, pictured: bool) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return features (N, F), PICTURED of the views with pictures or FEATURES of all, whether the outline is a needle's
    (N,), the view's seed (N,) and its case (N,)."""
    records = kept_records("stitch_absent", run).items()
    found = [(trial, record) for trial, record in records if len(record.presence) >= len(PICTURED if pictured else [0])]
    features = np.array([record.presence if pictured else record.presence[: len(FEATURES)] for _, record in found])
    if pictured:
        features = capped(features)
    return (
        features,
        np.array([float(record.found) for _, record in found]),
        np.array([int(trial.seed) for trial, _ in found]),
        np.array([trial.case for trial, _ in found]),
    )


def fitted(features: np.ndarray, answers: np.ndarray, pictured: bool) -> tuple[np.ndarray, float]:
    """Return weights (F,) and bias of a logistic function, with a ridge on standardised features."""
    mean, spread = features.mean(axis=0), np.maximum(features.std(axis=0), 1e-9)
    scaled = (features - mean) / spread
    cost = COST if pictured else 1.0
    shares = np.where(answers > 0, 0.5 / answers.mean(), cost * 0.5 / (1 - answers.mean()))
    shares /= len(answers) if pictured else 1.0

    def loss(weights: np.ndarray) -> float:
        margins = (2 * answers - 1) * (scaled @ weights[1:] + weights[0])
        return float(shares @ np.logaddexp(0.0, -margins) + RIDGES[pictured] * weights[1:] @ weights[1:])

    found = minimize(loss, np.zeros(features.shape[1] + 1)).x
    weights = found[1:] / spread
    return weights, float(found[0] - weights @ mean)


def main() -> None:
    """Fit, and say how well."""
    run = asked(Options).run
    for pictured in (False, True):
        features, answers, seeds, cases = samples(run, pictured)
        margins = np.empty(len(answers))
        for fold in range(FOLDS):
            left_out = seeds % FOLDS == fold
            weights, bias = fitted(features[~left_out], answers[~left_out], pictured)
            margins[left_out] = features[left_out] @ weights + bias
        for case in np.unique(cases):
            for right in (0.0, 1.0):
                of = (cases == case) & (answers == right)
                kind = "right" if right else "wrong"
                print(f"{case}, {of.sum()} {kind} outlines: {(margins[of] > 0.0).sum()} pass, left out")
        weights, bias = fitted(features, answers, pictured)
        named = dict(zip(PICTURED if pictured else FEATURES, np.round(weights, 2).tolist(), strict=True))
        print("PICTURED_WEIGHTS =" if pictured else "WEIGHTS =", named, "BIAS =", round(bias, 2))


if __name__ == "__main__":
    main()
