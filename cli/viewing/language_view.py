"""Places that words find: what a language map holds, and the answers to a query as boxes."""

from __future__ import annotations

import numpy as np
from scenewright.cli.viewing.inputs import input_artifact
from scenewright.cli.viewing.splat_view import draw_splat
from scenewright.schemas.language_map import Answer, Answers, LanguageMap
from scenewright.schemas.splat import Splat
from scenewright.stages.kit.drawing.palette import instance_color
from scenewright.stages.kit.open_words.vectors import read_vectors
from scenewright.stages.kit.viewing.canvas import Canvas

FEWEST_LOOKS = 1
"""Fewest looks of a region that is drawn."""
MOST_BOXES = 300
"""Most boxes that are drawn of a splat's pieces, the largest."""


def draw_language_map(language: LanguageMap, canvas: Canvas) -> None:
    """Draw the splat that it was made of, where that is still there; every Gaussian in the colour of its coarsest
    piece; and the boxes of what was looked at."""
    info = language.info
    splat = input_artifact(language, Splat) if info.source == "splat" else None
    if splat is not None:
        draw_splat(splat, canvas)
        canvas.view("colours", "pieces", "places")
        canvas.view("pieces", "gaussians", "camera")
    canvas.document(
        "language", f"{len(info.regions)} places of a {info.source.replace('_', ' ')}, encoder: {info.encoder}"
    )
    vectors = read_vectors(language)
    if len(vectors.means):
        coarse = vectors.pieces[-1] if len(vectors.pieces) else np.zeros(len(vectors.means), int)
        canvas.points("pieces", vectors.means, _colors_of(coarse), 0.012)
    looked_at = [(k, region) for k, region in enumerate(info.regions) if region.looks >= FEWEST_LOOKS]
    looked_at = sorted(looked_at, key=lambda each: -max(each[1].box.size))[:MOST_BOXES]
    canvas.boxes(
        "places",
        [region.box for _, region in looked_at],
        [f"{region.class_name or 'piece'} {region.instance or k}" for k, region in looked_at],
        [instance_color(k + 1) for k, _ in looked_at],
        show_labels=False,
    )


def draw_answers(answers: Answers, canvas: Canvas) -> None:
    """Draw the answers as boxes, greener the likelier, and list them."""
    info = answers.info
    lines = [f"# {info.text}", "", "| probability | where | node |", "|---|---|---|"]
    none = "whether the room has one is unknown" if answers.outcome == "unknown" else "the room has none"
    lines += [_line(answer) for answer in info.answers] or [f"| | {none} | |"]
    if info.unread:
        lines += ["", f"The encoder has never read: {', '.join(info.unread)}"]
    if info.next_best is not None:
        lines += ["", f"Next best, below {info.least_probability:g}:", "", *lines[2:4], _line(info.next_best)]
    canvas.document("answers", "\n".join(lines))
    shares = [answer.probability for answer in info.answers]
    canvas.boxes(
        "answers",
        [answer.box for answer in info.answers],
        [f"{answer.probability:.2f} {answer.node}" for answer in info.answers],
        [(1.0 - share, 0.8 * share, 0.15) for share in shares],
    )


def _colors_of(numbers: np.ndarray) -> np.ndarray:
    palette = np.array([instance_color(k) for k in range(int(numbers.max(initial=0)) + 2)])
    return np.round(255 * palette[numbers + 1]).astype(np.uint8)


def _line(answer: Answer) -> str:
    at = ", ".join(f"{v:.2f}" for v in answer.box.center)
    beside = f" ({answer.other})" if answer.other else ""
    return f"| {answer.probability:.2f} | {at} | {answer.node}{beside} |"
