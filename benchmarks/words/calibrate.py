"""Fit the probabilities of answers on tuning rooms, and write data/words/calibration.toml.

    python -m benchmarks.words.calibrate --out FOLDER [--data FOLDER] [--write]

Twice a logistic function: of all regions, which ranks; and of the ranking's first three answers to every query, whose
relevancies are the greatest of many, so that what is said of an answer holds for answers.

A place is strange to the encoder from halfway (in ratio) between the generated room of which it recognises least and
the real log of which it recognises most: pictures of a camera, which it never learned from. What is fitted in rooms
counts there by the share of first answers that were right in those logs.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from pydantic import Field
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
from scipy.optimize import minimize

from benchmarks.experiments.real import EXPECTED
from benchmarks.options import Recipe, asked
from benchmarks.words.asked import NAMED_ROOMS, AskedLog, AskedRoom

ROOMS = {
    "splat": ("kitchen-40", "office-41"),
    "panoptic_map": ("kitchen-40", "office-41", "bedroom-42", "room-43"),
    NAMED_SPLAT: NAMED_ROOMS,
}
LOGS = ("kitchen", "office")
"""Real ones that were looked at."""
LEAST_SHARE = 0.01
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
    """Return (R, 7): one, log odds of looks and field, logarithm of the edge and its square, whether a region has a
    class and how alike that and the text are; and which are seen."""
    found = finder.fits(text)
    e = np.log(np.maximum(finder.index.extents, SHORTEST))
    field = log_odds(found.field) if found.field is not None else np.zeros(len(e))
    alike = TEMPERATURE * (class_vectors(finder.info, finder.encoder) @ finder.encoder.texts((text,))[0])
    known = (finder.info.source == "splat") & ~np.isnan(alike)
    columns = [np.ones(len(e)), log_odds(found.looks), field, e, e**2, known, np.where(known, alike, 0.0)]
    return np.stack(columns, axis=1), found.looks > 0


def fit(rooms: list[AskedRoom], source: str) -> Calibration:
    """Return what the rooms' queries say of a source."""
    encoder = EmbeddedEncoder()
    language = {"splat": "nameless", "panoptic_map": "entities", NAMED_SPLAT: "language"}[source]
    finders = [Finder(getattr(room, language), encoder) for room in rooms]
    inputs, right = [], []
    for room, finder in zip(rooms, finders, strict=True):
        places = [finder.place(k) for k in range(len(finder.info.regions))]
        for query in (*room.queries[0], *room.queries[1]):
            rows, seen = inputs_of(finder, query.text)
            inputs.append(rows[seen])
            right.append(np.array([room.at(places[k], query) for k in np.flatnonzero(seen)], float))
    ranking = logistic(np.concatenate(inputs), np.concatenate(right))
    scores, truths = [], []
    for room, finder in zip(rooms, finders, strict=True):
        finder.calibration = fitted([float(w) for w in ranking])
        finder.classes = class_vectors(finder.info, encoder) if source == NAMED_SPLAT else None
        for query in (*room.queries[0], *room.queries[1]):
            rows, _ = inputs_of(finder, query.text)
            for found in finder.find(query.text)[:FIRST]:
                scores.append(rows[found.region] @ ranking)
                truths.append(room.at(finder.place(found.region), query))
    shift, slope = logistic(np.stack([np.ones(len(scores)), scores], axis=1), np.array(truths, float))
    weights = slope * ranking
    weights[0] += shift
    return fitted([round(float(w), 4) for w in weights])


def recognised_by(encoder: EmbeddedEncoder, language: LanguageMap) -> float:
    """Return how much of a place an encoder recognises, whether anything was fitted for it yet or not."""
    finder = Finder(language, encoder)
    return recognised(finder.vectors.regions, finder.index.extents, encoder)


def of_places(rooms: list[AskedRoom], logs: list[AskedLog]) -> tuple[float, float]:
    """Return from which share recognised on a place is known, and by how much what is fitted counts where it is not."""
    encoder = EmbeddedEncoder()
    known = [recognised_by(encoder, room.language) for room in rooms]
    strange = [recognised_by(encoder, log.language) for log in logs]
    finders = [Finder(log.language, encoder) for log in logs]
    firsts = [
        (log, query, finder.place(finder.find(query.text)[0].region))
        for log, finder in zip(logs, finders, strict=True)
        for query in (*log.queries[0], *log.queries[1])
    ]
    right = [log.at(place, query) for log, query, place in firsts]
    least = np.sqrt(min(known) * max(strange))
    return round(float(least), 3), round(max(float(np.mean(right)), LEAST_SHARE), 3)


class Options(Recipe):
    """Options."""

    data: Path = Field(Path("../shared/data"), description="Folder with the real logs")
    frames: int = Field(24, description="Frames of a room")
    steps: int = Field(200, description="Steps of the field")
    write: bool = Field(False, description="Write data/words/calibration.toml")


def room_of(options: Options, name: str) -> AskedRoom:
    """Return a generated room."""
    return AskedRoom(options.out / "rooms", name, options.steps, options.frames)


def log_of(options: Options, name: str) -> AskedLog:
    """Return a real log."""
    told = EXPECTED[name]
    return AskedLog(options.out / "logs", name, options.steps, options.data / told["log"], told["every"])


def main() -> None:
    """Fit every source."""
    options = asked(Options)
    lines = []
    rooms = [room_of(options, name) for name in ROOMS["splat"][: 1 if options.quick else None]]
    logs = [log_of(options, name) for name in LOGS[: 1 if options.quick else None]]
    least_recognised, strange = of_places(rooms, logs)
    for source, names in ROOMS.items():
        some = names[: 1 if options.quick else None]
        found = fit([room_of(options, name) for name in some], source)
        values = {name: getattr(found, name) for name in WEIGHTS}
        values |= {"least_recognised": least_recognised, "strange": strange}
        entry = [f'source = "{source}"', f'encoder = "{EmbeddedEncoder().label}"']
        entry += [f"{name} = {value}" for name, value in values.items()]
        lines.append("[[fit]]\n" + "\n".join(entry) + "\n")
        print(lines[-1], flush=True)
    target = BUNDLED if options.write else Path(options.out) / "calibration.toml"
    target.parent.mkdir(parents=True, exist_ok=True)
    target.write_text(HEADER + "\n" + "\n".join(lines))


if __name__ == "__main__":
    main()
