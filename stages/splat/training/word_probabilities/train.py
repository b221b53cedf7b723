"""Fit the probabilities of answers on tuning rooms; `--write` writes data/words/calibration.toml.

    scenewright train word-probabilities --places FOLDER --out FOLDER [--write]

Twice a logistic function: of all regions, which ranks; and of the ranking's first three answers to every query, whose
relevancies are the greatest of many, so that what is said of an answer holds for answers.

A place is strange to the encoder from halfway (in ratio) between the generated room of which it recognises least and
the real log of which it recognises most: pictures of a camera, which it never learned from. What is fitted in rooms
counts there by the share of first answers that were right in those logs.
"""

from __future__ import annotations

import logging
from pathlib import Path

import numpy as np
from scenewright.schemas.language_map import LanguageMap
from scenewright.stages.kit.open_words.calibration import (
    BUNDLED,
    NAMED_SPLAT,
    SHORTEST,
    WEIGHTS,
    Calibration,
    fitted,
    log_odds,
    recognised,
)
from scenewright.stages.kit.open_words.embedded import EmbeddedEncoder
from scenewright.stages.kit.open_words.finding import Finder, class_vectors
from scenewright.stages.kit.open_words.relevancy import TEMPERATURE
from scenewright.stages.splat.training.word_probabilities import ProbabilitiesTraining
from scenewright.stages.splat.training.word_probabilities.asked_places import KNOWN, STRANGE, AskedPlace, read_places
from scipy.optimize import minimize

_LOGGER = logging.getLogger("scenewright")
SOURCES = ("splat", "panoptic_map", NAMED_SPLAT)
LEAST_SHARE = 0.01
"""Smallest prior probability, where hardly an answer was right."""
FIRST = 3
"""Answers to a query that are learnt from: the first of these."""
RIDGE = 1e-3
"""Weight of the squared coefficients in the loss. By eye."""
HEADER = """# Relevancies as probabilities (stages/kit/open_words/calibration.py), fitted on tuning rooms, for one
# encoder, by scenewright train word-probabilities.
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
    """Return (R, 7): one, log odds of looks and field, logarithm of the edge and its square, whether a region has a
    class and how alike that and the text are; and which are seen."""
    found = finder.fits(text)
    e = np.log(np.maximum(finder.index.extents, SHORTEST))
    field = log_odds(found.field) if found.field is not None else np.zeros(len(e))
    alike = TEMPERATURE * (class_vectors(finder.info, finder.encoder) @ finder.encoder.texts((text,))[0])
    known = (finder.info.source == "splat") & ~np.isnan(alike)
    columns = [np.ones(len(e)), log_odds(found.looks), field, e, e**2, known, np.where(known, alike, 0.0)]
    return np.stack(columns, axis=1), found.looks > 0


def fit(places: list[AskedPlace], source: str) -> Calibration:
    """Return what the places' queries say of a source."""
    encoder = EmbeddedEncoder()
    finders = [Finder(place.language, encoder) for place in places]
    inputs, right = [], []
    for place, finder in zip(places, finders, strict=True):
        for query in place.queries:
            rows, seen = inputs_of(finder, query.text)
            inputs.append(rows[seen])
            right.append(np.array(query.right, float)[seen])
    ranking = logistic(np.concatenate(inputs), np.concatenate(right))
    scores, truths = [], []
    for place, finder in zip(places, finders, strict=True):
        finder.calibration = fitted([float(w) for w in ranking])
        finder.classes = class_vectors(finder.info, encoder) if source == NAMED_SPLAT else None
        for query in place.queries:
            rows, _ = inputs_of(finder, query.text)
            for found in finder.find(query.text)[:FIRST]:
                scores.append(rows[found.region] @ ranking)
                truths.append(query.right[found.region])
    shift, slope = logistic(np.stack([np.ones(len(scores)), scores], axis=1), np.array(truths, float))
    weights = slope * ranking
    weights[0] += shift
    return fitted([round(float(w), 4) for w in weights])


def recognised_by(encoder: EmbeddedEncoder, language: LanguageMap) -> float:
    """Return how much of a place an encoder recognises, whether anything was fitted for it yet or not."""
    finder = Finder(language, encoder)
    return recognised(finder.vectors.regions, finder.index.extents, encoder)


def of_places(known: list[AskedPlace], strange: list[AskedPlace]) -> tuple[float, float]:
    """Return from which share recognised on a place is known, and by how much what is fitted counts where it is not."""
    encoder = EmbeddedEncoder()
    most_strange = max(recognised_by(encoder, place.language) for place in strange)
    least = np.sqrt(min(recognised_by(encoder, place.language) for place in known) * most_strange)
    finders = [Finder(place.language, encoder) for place in strange]
    right = [
        query.right[finder.find(query.text)[0].region]
        for place, finder in zip(strange, finders, strict=True)
        for query in place.queries
    ]
    return round(float(least), 3), round(max(float(np.mean(right)), LEAST_SHARE), 3)


def train(options: ProbabilitiesTraining, out: Path) -> None:
    """Fit every source. Raises BadInput for a folder without places."""
    places = read_places(options.places)
    least_recognised, strange = of_places(
        *([place for place in places if place.use == use] for use in (KNOWN, STRANGE))
    )
    lines = []
    for source in SOURCES:
        found = fit([place for place in places if place.use == source], source)
        values = {name: getattr(found, name) for name in WEIGHTS}
        values |= {"least_recognised": least_recognised, "strange": strange}
        entry = [f'source = "{source}"', f'encoder = "{EmbeddedEncoder().label}"']
        entry += [f"{name} = {value}" for name, value in values.items()]
        lines.append("[[fit]]\n" + "\n".join(entry) + "\n")
        _LOGGER.info("%s", ", ".join(entry))
    target = BUNDLED if options.write else out / "calibration.toml"
    target.parent.mkdir(parents=True, exist_ok=True)
    target.write_text(HEADER + "\n" + "\n".join(lines))
