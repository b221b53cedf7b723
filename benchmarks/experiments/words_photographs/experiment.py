"""Recorded rooms that are asked: names by networks of photographs through one reading of words, beside looks alone.

Phrases were drawn beforehand (drawing.py). `thesis` asks the language field of a splat with the embedded encoder, at
the size that fits best in the image that shows a right thing best, and always answers with one Gaussian. In
`thesis_witnesses` every Gaussian has instead of vectors what the same masks say of it in the images that show it, and
nouns are read as in ours; it always answers too. `entities` asks what images show of every entity of the map, by the
encoder. `ours` asks the same entities by names with probabilities, colours, sizes and the contact graph; `ours_classes`
does without WordNet.

Two bounds stand beside `ours`: how many things the map has an entity of, and how many are among the places of a phrase
at all, whatever their order and threshold. No order of the same names finds more than the second.

The thresholds from which a place counts as an answer come from generated rooms on which probabilities were fitted
(`threshold`): there nine of ten absent phrases are rejected. In the first column, as for generated rooms, nine of ten
absent phrases of these logs are rejected.
"""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from pydantic import Field
from scenewright.stages.kit.geometry.boxes import box_iou
from scenewright.stages.kit.labels import load_label_set
from scenewright.stages.kit.measurement.bootstrap import Interval
from scenewright.stages.kit.open_words.finding import Finder, heard
from scenewright.stages.kit.open_words.opening import open_encoder
from scenewright.stages.kit.open_words.options import EncoderParameters
from scenewright.stages.kit.open_words.reading.meaning import Meanings
from scenewright.stages.kit.stage import Parameters
from scenewright.stages.splat import recall_at_rejection

from benchmarks.board.real.logs import ANNOTATED, ANNOTATIONS, LOGS, OUTLINES
from benchmarks.experiment import Bench, Experiment, Measure, Results, Trial
from benchmarks.experiments.legs_words import BOX_OVERLAP, AlwaysAnswering, Place, ThesisWay
from benchmarks.experiments.words_photographs.drawing import LIST, Asked
from benchmarks.experiments.words_photographs.places import AskedPhotographs
from benchmarks.words.asked import Query

CASE = "photographs"
KNOWN_SETS = ("coco-80", "ade20k-31", "pascal-voc")
"""Label sets of the networks that give masks."""
ALWAYS = ("thesis", "thesis_witnesses")
"""Arms that always answer."""


class PhotographsParameters(Parameters):
    """Options of the experiment."""

    data: Path = Field(Path("../shared/data"), description="Folder with the real logs and networks of others")
    steps: int = Field(200, ge=1, description="Steps of training the field")
    threshold: float = Field(0.042, ge=0, le=1, description="Probability from which on ours answers (words_relations)")


@dataclass(frozen=True)
class Told:
    """What an arm made of one phrase."""

    text: str
    log: str
    kind: str
    known: bool
    """Whether its noun names a class of which one of the networks has a label."""
    present: bool
    chance: float
    """Probability, or relevancy, of its first place."""
    answered: bool
    at: bool
    """Its first place lies in the box of a right thing ..."""
    overlaps: bool
    """... and its box overlaps with that."""
    pictured: bool | None
    """It lies in the picture's box of a right thing, in the held-out image that shows one best; None: there is none."""
    precise: bool
    """It is at a thing of which the phrase is, or may be, true."""
    mapped: bool | None
    """Some entity of the map is at a right thing; None of an arm that asks no entities."""
    among: bool
    """Some place of its answer is at a right thing."""
    milliseconds: float


def asked_of(log: str) -> list[tuple[Asked, bool]]:
    """Return the phrases of a log, and whether they are of things that are there."""
    rows = json.loads(LIST.read_text(encoding="utf-8"))[log]
    return [
        (Asked(row["text"], row["kind"], tuple(row["right"]), tuple(row["maybe"])), kind == "present")
        for kind in ("present", "absent")
        for row in rows[kind]
    ]


def is_known(text: str) -> bool:
    """Whether the noun of a phrase names a class that a network has a label for."""
    phrase = heard(text)
    classes = {label.class_name for name in KNOWN_SETS for label in load_label_set(name).labels}
    return phrase is not None and any(name in classes for name in phrase.classes())


def seeds_of(bench: Bench, case: str) -> Sequence[str]:
    """Phrases of the logs that are at hand, by log and number."""
    logs = [log for log in ANNOTATED if LOGS[log].within(bench.parameters.data).path.exists()]
    return [f"{log}-{k:02d}" for log in logs for k in range(len(asked_of(log)))]


def log_of(seed: str) -> str:
    """Return the log of a phrase."""
    return seed.rsplit("-", 1)[0]


def measure(bench: Bench, trials: Sequence[Trial]) -> Iterator[tuple[Trial, Told]]:
    """Ask a log in every arm."""
    given, name = bench.parameters, log_of(trials[0].seed)
    log = LOGS[name].within(given.data)
    room = AskedPhotographs(bench.out, name, given.steps, log.path, log.every, given.data)
    phrases = asked_of(name)
    for arm in dict.fromkeys(trial.arm for trial in trials):
        ask = way_of(room, arm, given)
        for trial in (each for each in trials if each.arm == arm):
            phrase, present = phrases[int(trial.seed.rsplit("-", 1)[1])]
            yield trial, told(room, phrase, present, ask, arm, 0.0 if arm in ALWAYS else given.threshold)


def told(
    room: AskedPhotographs, asked: Asked, present: bool, ask: Callable[[Query], list[Place]], arm: str, least: float
) -> Told:
    """Ask one phrase and judge its first place, which is an answer where it is as likely as `least`."""
    right = tuple(room.number[name] for name in asked.right)
    query, maybe = Query(asked.text, right), tuple(room.number[name] for name in asked.maybe)
    began = time.process_time()
    places = ask(query)
    spent = 1e3 * (time.process_time() - began)
    first = places[0] if places else None
    chance = 0.0 if first is None else first.probability
    answered = first is not None and chance >= least and chance > 0
    return Told(
        text=asked.text,
        log=room.name,
        kind=asked.kind,
        known=is_known(asked.text),
        present=present,
        chance=round(chance, 4),
        answered=answered,
        at=first is not None and room.at(first.point, query),
        overlaps=first is not None and first.overlaps,
        pictured=None if room.best_view(query) is None or first is None else room.within_picture(first.point, query),
        precise=first is not None and room.at(first.point, replace(query, right=right + maybe)),
        mapped=None if arm in ALWAYS else any(room.at(place, query) for place in room.entity_places),
        among=any(place.probability > 0 and room.at(place.point, query) for place in places),
        milliseconds=spent,
    )


def way_of(room: AskedPhotographs, arm: str, given: PhotographsParameters) -> Callable[[Query], list[Place]]:
    """Return how an arm answers a query."""
    encoder = open_encoder(EncoderParameters.model_validate({}), None)
    if arm == "thesis":
        finder = Finder(room.language, encoder)
        way: AlwaysAnswering = ThesisWay(room, finder, finder.vectors.vectors)
        return way.find
    if arm == "thesis_witnesses":
        return WitnessWay(room, Meanings()).find
    finder = Finder(room.labels, encoder, meanings=Meanings(with_nouns=arm != "ours_classes"))
    if arm == "entities":
        finder.has_names = False
    return lambda query: entity_places(room, finder, query, related=arm != "entities")


def entity_places(room: AskedPhotographs, finder: Finder, query: Query, related: bool) -> list[Place]:
    """Return the places that a finder of entities gives, with the contact graph where `related`."""
    phrase = heard(query.text) if related else None
    if phrase is not None and phrase.other is not None:
        found = finder.find_related(phrase, room.graph.info)
    else:
        found = finder.find(query.text, phrase)
    places = []
    for each in found:
        box = finder.info.regions[each.region].box
        overlaps = any(box_iou(box, room.boxes[k]) >= BOX_OVERLAP for k in query.right)
        places.append(Place(finder.place(each.region), each.probability, overlaps))
    return places


class WitnessWay:
    """The thesis's way with the networks as witnesses: the Gaussian of which masks say most what the noun means."""

    def __init__(self, room: AskedPhotographs, meanings: Meanings) -> None:
        self.names, self.field = room.witnessed
        self.means, self.meanings = room.vectors_means, meanings

    def find(self, query: Query) -> list[Place]:
        """Return its one answer; the first Gaussian where nothing fits."""
        phrase = heard(query.text)
        nouns = () if phrase is None else phrase.nouns
        weights = np.array([meaning.probability for meaning in self.meanings.of(nouns, self.names)])
        fits = self.field @ weights if len(weights) else np.zeros(len(self.means))
        best = int(fits.argmax())
        return [Place(self.means[best], float(fits[best]), False)]


def share(of: Callable[[Told], bool | None], among: Callable[[Told], bool] = lambda told: told.present) -> Measure:
    """Share of the records `among` that `of` is true of; those of which it is None are left out."""

    def figure(records: Sequence[Told]) -> float | None:
        values = [value for record in records if among(record) and (value := of(record)) is not None]
        return float(np.mean(values)) if values else None

    return Measure(figure)


def at_rejection(of: Callable[[Told], bool]) -> Measure:
    """Share of present phrases found at the one threshold that rejects nine of ten absent ones."""

    def figure(records: Sequence[Told]) -> float | None:
        present, absent = ([r for r in records if r.present is is_there] for is_there in (True, False))
        chances = np.array([r.chance for r in present]), np.array([r.chance for r in absent])
        return recall_at_rejection(chances[0], np.array([of(r) for r in present], bool), chances[1])

    return Measure(figure)


def kept(of: Callable[[Told], bool]) -> Callable[[Told], Told | None]:
    """Return a part of the records: the present phrases of which `of` is true, and all absent ones."""
    return lambda record: record if not record.present or of(record) else None


def differences(results: Results) -> dict[str, Interval | None]:
    """Return how much more ours finds than the rivals, with intervals over the same phrases."""
    return {
        f"ours less {other}/{case}/found_at_rejection": results.difference("ours", other, case, "found_at_rejection")
        for other in ("thesis_witnesses", "thesis", "entities")
        for case in ("all", "known")
        if other in results.arms(case) and "ours" in results.arms(case)
    }


EXPERIMENT = Experiment(
    name="words_photographs",
    title="Recorded rooms that are asked",
    simulated="Nothing, but the living room's images are rendered.",
    knows="Colour, depth and the logs' poses; networks frozen. `thesis` is given the held-out image that shows a right "
    "thing best.",
    does_not_show=(
        "Words that people choose: a program drew them. A room nobody looked at: one person annotated all three logs, "
        "and rules of the map were chosen on them. CLIP, SigLIP, NanoDet: not run."
    ),
    arms={
        "ours": "ours",
        "ours_classes": "ours, vocabulary alone",
        "entities": "entities by looks",
        "thesis_witnesses": "thesis's way, same networks",
        "thesis": "thesis's way, its encoder",
    },
    cases=(CASE,),
    seeds_of=seeds_of,
    together=lambda trial: log_of(trial.seed),
    measure=measure,
    record=Told,
    measures={
        "found_at_rejection": at_rejection(lambda told: told.at),
        "boxed_at_rejection": at_rejection(lambda told: told.overlaps),
        "found": share(lambda told: told.answered and told.at),
        "boxed": share(lambda told: told.answered and told.overlaps),
        "first_right": share(lambda told: told.at),
        "pictured": share(lambda told: told.pictured and told.answered if told.pictured is not None else None),
        "precision": share(lambda told: told.precise, lambda told: told.answered),
        "mapped": share(lambda told: told.mapped),
        "among": share(lambda told: told.among),
        "rejected": share(lambda told: not told.answered, lambda told: not told.present),
        "query_ms": Measure(lambda records: float(np.median([r.milliseconds for r in records])), "ms", False),
    },
    subcases={
        "all": (CASE, lambda record: record),
        "known": (CASE, kept(lambda record: record.known)),
        "unknown": (CASE, kept(lambda record: not record.known)),
        **{
            kind: (CASE, kept(lambda record, kind=kind: record.kind == kind))  # type: ignore[misc]
            for kind in ("noun", "synonym", "hypernym", "colour", "relation")
        },
        **{
            log: (CASE, lambda record, log=log: record if record.log == log else None)  # type: ignore[misc]
            for log in ANNOTATED
        },
    },
    pairs=(("ours", "thesis_witnesses"), ("ours", "entities"), ("ours", "thesis"), ("ours", "ours_classes")),
    compared=("found_at_rejection", "first_right"),
    more_figures=differences,
    parameters=PhotographsParameters,
    places=frozenset({"data"}),
    inputs=lambda bench, trial: [
        LIST,
        ANNOTATIONS / f"{log_of(trial.seed)}.json",
        *(path for path in (OUTLINES / f"{log_of(trial.seed)}.json",) if path.is_file()),
        LOGS[log_of(trial.seed)].within(bench.parameters.data).path,
    ],
    steps=("ingest", "segment", "fuse", "graph", "splat build", "splat language", "splat label", "truth supports"),
)
