"""The step `splat evaluate`: how well a place that somebody knows is answered for."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scenewright.schemas.evaluation import Evaluation, MetricsFile
from scenewright.schemas.language_map import LanguageMap
from scenewright.stages.kit.drawing.plots import plot_histograms
from scenewright.stages.kit.geometry.boxes import points_in_box
from scenewright.stages.kit.measurement.tables import Table, write_table
from scenewright.stages.kit.open_words.encoder import check_width
from scenewright.stages.kit.open_words.finding import Finder
from scenewright.stages.kit.open_words.opening import open_encoder
from scenewright.stages.kit.stage import Context
from scenewright.stages.splat.asked_figures import REJECTED, calibration_error, recall_at_rejection
from scenewright.stages.splat.asked_file import read_asked
from scenewright.stages.splat.parameters import EvaluateParameters

MARGIN = 0.02
"""A place is at a thing when it lies within its box grown by this on every side [m]."""


@dataclass(frozen=True)
class First:
    """The likeliest place for a text."""

    text: str
    there: bool
    probability: float
    """0: no place at all."""
    right: bool
    place: np.ndarray | None
    """(3,) [m]"""
    unknown: bool = False
    """Whether the encoder cannot say that it is not there."""


def run(
    language: LanguageMap, queries: Path, weights: Path | None, *, parameters: EvaluateParameters, context: Context
) -> Evaluation:
    """Ask every text of a file and compare first answers with what the file says.

    Raises BadInput for a file that does not say it, or for an encoder other than that of the map.
    """
    questions, info = read_asked(queries), language.info
    encoder = open_encoder(parameters, weights, context.device)
    check_width(encoder, info.width, info.encoder, str(language.root))
    finder = Finder(language, encoder)
    texts = [(each.text, each.boxes) for each in questions.there] + [(text, ()) for text in questions.absent]
    firsts = []
    for number, (text, boxes) in enumerate(context.progress.track(texts, total=len(texts), description="queries")):
        first_answer = next(iter(finder.find(text)), None)
        position = None if first_answer is None else finder.place(first_answer.region)
        right = position is not None and any(points_in_box(box, position[None], MARGIN)[0] for box in boxes)
        chance = 0.0 if first_answer is None else round(first_answer.probability, 6)
        known_there = number < len(questions.there)
        firsts.append(First(text, known_there, chance, bool(right), position, finder.cannot_tell(text)))
    least = parameters.least_probability
    file = MetricsFile(label=encoder.label, metrics=figures(firsts, least), notes=_notes(finder, firsts))
    file.write(context.output / "metrics.json")
    for folder in ("tables", "plots"):
        (context.output / folder).mkdir()
    write_table(context.output / "tables", answers_table(firsts, least))
    groups = {
        "right": [f.probability for f in firsts if f.there and f.right],
        "wrong": [f.probability for f in firsts if f.there and not f.right],
        "absent": [f.probability for f in firsts if not f.there],
    }
    plot_histograms(
        context.output / "plots" / "probabilities.png",
        {name: np.array(values) for name, values in groups.items() if values},
        title=f"Probability of the first place for a text\n{encoder.label}",
        axis="probability",
        limit=1.0,
        threshold=least,
    )
    rounded = {name.split("/")[1]: round(value, 4) for name, value in file.metrics.items() if value is not None}
    return Evaluation(context.output, outcome="ok", summary=rounded)


def figures(firsts: list[First], least: float) -> dict[str, float | None]:
    """Return the measures of first answers, of which those from probability `least` on count."""
    present, absent = [f for f in firsts if f.there], [f for f in firsts if not f.there]
    answered = [f for f in present if f.probability >= least]
    chances = {
        kind: np.array([f.probability for f in group]) for kind, group in (("there", present), ("absent", absent))
    }
    right = np.array([f.right for f in present], bool)
    return {
        "words/there": float(len(present)),
        "words/absent": float(len(absent)),
        "words/recall": sum(f.right for f in answered) / len(present) if present else None,
        "words/precision": sum(f.right for f in answered) / len(answered) if answered else None,
        "words/absent_rejected": sum(f.probability < least for f in absent) / len(absent) if absent else None,
        "words/recall_at_rejection": recall_at_rejection(chances["there"], right, chances["absent"]),
        "words/calibration_error": calibration_error(
            np.array([f.probability for f in firsts]), np.array([f.right for f in firsts])
        ),
    }


def answers_table(firsts: list[First], least: float) -> Table:
    """Return a row for every text."""
    rows = []
    for first in firsts:
        answered = first.probability >= least
        none = "unknown" if first.unknown else "missed" if first.there else "rejected"
        verdict = ("right" if first.right else "wrong") if answered else none
        rows.append(
            (
                first.text,
                "yes" if first.there else "no",
                first.probability,
                verdict,
                *([None] * 3 if first.place is None else first.place.tolist()),
            )
        )
    columns = ("text", "there", "probability", "answer", "x [m]", "y [m]", "z [m]")
    note = (
        f"An answer counts from probability {least:g} on; nothing that is not there has a right one; "
        "unknown: below it, of words or images that the encoder has never learned."
    )
    return Table("answers", "First answers", columns, tuple(rows), note)


def _notes(finder: Finder, firsts: list[First]) -> tuple[str, ...]:
    share = f"{100 * REJECTED:g} %"
    notes = [f"recall_at_rejection: found at the one threshold that rejects {share} of the texts that are not there."]
    if not finder.calibration.fitted:
        notes.append("Nothing was fitted for this encoder: its probabilities are relevancies.")
    if finder.is_strange:
        notes.append("The images are near nothing that the encoder has learned; hardly anything is believed.")
    unread = sorted({word for first in firsts for word in finder.encoder.unread(first.text)})
    if unread:
        notes.append(f"The encoder has never read {', '.join(unread)}.")
    return tuple(notes)
