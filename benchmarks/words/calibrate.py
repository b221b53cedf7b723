"""Fit the probabilities of answers on tuning rooms, and write data/words/calibration.toml.

    python -m benchmarks.words.calibrate --out FOLDER [--write]

Twice a logistic function: of all regions, which ranks; and of the ranking's first three answers to every query, whose
relevancies are the greatest of many, so that what is said of an answer holds for answers.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from pydantic import Field
from scipy.optimize import minimize

from benchmarks.options import Recipe, asked
from benchmarks.words.asked import AskedRoom
from stages.kit.open_words.calibration import BUNDLED, SHORTEST, Calibration, fitted, log_odds
from stages.kit.open_words.embedded import EmbeddedEncoder
from stages.kit.open_words.finding import Finder

ROOMS = {"splat": ("kitchen-40", "office-41"), "panoptic_map": ("kitchen-40", "office-41", "bedroom-42", "room-43")}
FIRST = 3
RIDGE = 1e-3
HEADER = """# Relevancies as probabilities (stages/kit/open_words/calibration.py), fitted on tuning rooms, for one
# encoder, by python -m benchmarks.words.calibrate.
"""


def logistic(inputs: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Return weights (F,) of inputs (N, F) that make right (N,) likeliest, with a small ridge."""

    def loss(weights: np.ndarray) -> tuple[float, np.ndarray]:
        odds = inputs @ weights
        chance = 1.0 / (1.0 + np.exp(-odds))
        value = np.mean(np.logaddexp(0, odds) - right * odds) + RIDGE * float(weights @ weights)
        return value, inputs.T @ (chance - right) / len(right) + 2 * RIDGE * weights

    return minimize(loss, np.zeros(inputs.shape[1]), jac=True, method="L-BFGS-B").x


def inputs_of(finder: Finder, text: str) -> tuple[np.ndarray, np.ndarray]:
    """Return (R, 5): one, log odds of looks and field, logarithm of the edge and its square; and which are seen."""
    found = finder.fits(text)
    e = np.log(np.maximum(finder.index.extents, SHORTEST))
    field = log_odds(found.field) if found.field is not None else np.zeros(len(e))
    return np.stack([np.ones(len(e)), log_odds(found.looks), field, e, e**2], axis=1), found.looks > 0


def fit(rooms: list[AskedRoom], source: str) -> Calibration:
    """Return what the rooms' queries say of a source."""
    encoder = EmbeddedEncoder()
    finders = [Finder(room.language if source == "splat" else room.entities, encoder) for room in rooms]
    inputs, right = [], []
    for room, finder in zip(rooms, finders, strict=True):
        centers = [np.array(region.box.center) for region in finder.info.regions]
        for query in (*room.queries[0], *room.queries[1]):
            rows, seen = inputs_of(finder, query.text)
            inputs.append(rows[seen])
            right.append(np.array([room.at(centers[k], query) for k in np.flatnonzero(seen)], float))
    ranking = logistic(np.concatenate(inputs), np.concatenate(right))
    scores, truths = [], []
    for room, finder in zip(rooms, finders, strict=True):
        finder.calibration = fitted([float(w) for w in ranking])
        for query in (*room.queries[0], *room.queries[1]):
            rows, _ = inputs_of(finder, query.text)
            for found in finder.find(query.text)[:FIRST]:
                scores.append(rows[found.region] @ ranking)
                truths.append(room.at(np.array(finder.info.regions[found.region].box.center), query))
    shift, slope = logistic(np.stack([np.ones(len(scores)), scores], axis=1), np.array(truths, float))
    weights = slope * ranking
    weights[0] += shift
    return fitted([round(float(w), 4) for w in weights])


class Options(Recipe):
    """Options."""

    frames: int = Field(24, description="Frames of a room")
    steps: int = Field(200, description="Steps of the field")
    write: bool = Field(False, description="Write data/words/calibration.toml")


def main() -> None:
    """Fit both sources."""
    options = asked(Options)
    lines = []
    for source, names in ROOMS.items():
        some = names[: 1 if options.quick else None]
        rooms = [AskedRoom(options.out / "rooms", name, options.steps, options.frames) for name in some]
        found = fit(rooms, source)
        values = {name: getattr(found, name) for name in ("bias", "looks", "field", "extent", "extent_squared")}
        entry = [f'source = "{source}"', f'encoder = "{EmbeddedEncoder().label}"']
        entry += [f"{name} = {value}" for name, value in values.items()]
        lines.append("[[fit]]\n" + "\n".join(entry) + "\n")
        print(lines[-1], flush=True)
    target = BUNDLED if options.write else Path(options.out) / "calibration.toml"
    target.parent.mkdir(parents=True, exist_ok=True)
    target.write_text(HEADER + "\n" + "\n".join(lines))


if __name__ == "__main__":
    main()
