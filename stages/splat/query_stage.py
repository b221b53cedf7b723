"""The step `splat query`: where in a room a text fits, or that it has none."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scenewright.schemas.contact_graph import ContactGraph, ContactGraphFile
from scenewright.schemas.errors import BadInput, UsageError
from scenewright.schemas.language_map import Answer, Answers, AnswersFile, LanguageMap
from scenewright.stages.kit.formats.map_files import write_arrays
from scenewright.stages.kit.open_words.encoder import check_width, checked_text
from scenewright.stages.kit.open_words.finding import Finder, Found
from scenewright.stages.kit.open_words.opening import open_encoder
from scenewright.stages.kit.open_words.reading.phrase import Contradiction, Phrase, read_phrase
from scenewright.stages.kit.stage import Context
from scenewright.stages.splat.parameters import QueryParameters


def run(
    language: LanguageMap,
    contact_graph: ContactGraph | None,
    weights: Path | None,
    *,
    parameters: QueryParameters,
    context: Context,
) -> Answers:
    """Rank the places that fit a text. Where none is likely enough the outcome is `absent`, or `unknown` of words or
    pictures that the encoder has never learned.

    Raises BadInput for an encoder other than that of the map, or for a contact graph of another map.
    """
    text, info = checked_text(parameters.text), language.info
    encoder = open_encoder(parameters, weights, context.device)
    check_width(encoder, info.width, info.encoder, str(language.root))
    finder = Finder(language, encoder)
    graph = contact_graph.info if contact_graph is not None else None
    phrase, heard_line = _read(text)
    parts: tuple[str, ...] = (text,)
    relation = ""
    if graph is not None and phrase is not None and phrase.other is not None:
        _check_same_map(language, graph)
        ranking = finder.find_related(phrase, graph)
        parts = (phrase.thing(), phrase.other.thing())
        relation = f" {phrase.relation} ".join(parts)
    else:
        ranking = finder.find(text, phrase)
    context.logger.info("%s", heard_line)
    nodes = {node.instance: node.id for node in graph.nodes if node.instance} if graph is not None else {}
    least = parameters.least_probability
    likely = [answer for answer in ranking if answer.probability >= least][: parameters.most]
    below = next((answer for answer in ranking if answer.probability < least), None)
    masks = [finder.index.members(answer.region) for answer in likely]
    unread = tuple(word for part in parts for word in encoder.unread(part))
    AnswersFile(
        text=text,
        encoder=encoder.label,
        calibrated=finder.calibration.fitted,
        recognised=None if finder.recognised is None else round(finder.recognised, 4),
        strange=finder.is_strange,
        least_probability=least,
        understood="" if phrase is None else phrase.said(),
        unread=unread,
        relation=relation,
        answers=tuple(_answer(finder, answer, nodes) for answer in likely),
        next_best=None if below is None else _answer(finder, below, nodes),
    ).write(context.output / "answers.json")
    starts = np.concatenate([[0], np.cumsum([len(mask) for mask in masks])]).astype(np.int64)
    gaussians = np.concatenate([*masks, np.zeros(0, int)]).astype(np.int32)
    write_arrays(context.output / "masks.npz", {"gaussians": gaussians, "starts": starts})
    summary: dict[str, object] = {"answers": len(likely)}
    if likely:
        summary["best"] = round(likely[0].probability, 3)
        summary["place"] = [round(float(v), 3) for v in finder.place(likely[0].region)]
    if finder.is_strange and not finder.by_names:
        context.logger.warning(
            "its images are near nothing that the encoder has learned (%.2f, known from %.2f on): "
            "answers %s; a map made with another --encoder may tell more",
            finder.recognised,
            finder.calibration.least_recognised,
            "are guesses" if likely else "would be guesses, which --least-probability 0 shows",
        )
        summary["strange"] = True
    if likely and likely[0].doubtful:
        context.logger.warning("the first answer rests on one doubtful name: look before you trust it")
    if unread and not finder.by_names:
        found_for_it = "what is found for it is a guess" if likely else "whether it is there is unknown"
        context.logger.warning("the encoder has never read %s: %s", ", ".join(unread), found_for_it)
        summary["unread"] = " ".join(unread)
    none = "unknown" if finder.cannot_tell(*parts) else "absent"
    return Answers(context.output, outcome="ok" if likely else none, summary=summary)


def _read(text: str) -> tuple[Phrase | None, str]:
    """Return what a text is read as, and a line that says so, or why only the encoder may understand it. Raises
    UsageError for a contradiction."""
    try:
        phrase = read_phrase(text)
    except Contradiction:
        raise
    except UsageError as error:
        return None, f"{error.message}; the encoder is asked all the same"
    return phrase, phrase.said()


def _check_same_map(language: LanguageMap, graph: ContactGraphFile) -> None:
    in_graph = {node.instance for node in graph.nodes}
    in_map = {region.instance for region in language.info.regions}
    if language.info.source != "panoptic_map" or not in_graph & in_map - {0}:
        raise BadInput(
            f"{language.root}: its places are no nodes of the contact graph",
            hint="label the map that the graph was made of: scenewright splat label",
        )


def _answer(finder: Finder, found: Found, nodes: dict[int, str]) -> Answer:
    region = finder.info.regions[found.region]
    x, y, z = (round(float(v), 4) for v in finder.place(found.region))
    return Answer(
        region=found.region,
        probability=round(found.probability, 6),
        relevancy=round(found.relevancy, 6),
        field_relevancy=None if found.field_relevancy is None else round(found.field_relevancy, 6),
        size=found.size,
        instance=region.instance,
        node=nodes.get(region.instance, ""),
        other=nodes.get(found.other, ""),
        doubtful=found.doubtful,
        place=(x, y, z),
        box=region.box,
        gaussians=len(finder.index.members(found.region)),
    )
