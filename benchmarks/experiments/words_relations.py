"""Generated rooms asked by names alone, as recorded ones are: what rejects, and how often relations are right.

The map is of our own network's masks. Its entities are asked by the names and posteriors that the map gave them,
without looks; relations are answered by its contact graph. Texts are those that generated rooms are asked, and for
relations "noun on the noun" of every pair of classes of which one truly stands on the other. The rooms are those on
which the encoder's probabilities were fitted; of names, relations and layers of words nothing was.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from pydantic import Field
from scenewright.schemas.contact_graph import ContactGraph
from scenewright.schemas.language_map import LanguageMap
from scenewright.schemas.scene_parts import TREE_RELATIONS
from scenewright.stages.kit.open_words.finding import Finder, Found, heard
from scenewright.stages.kit.open_words.opening import open_encoder
from scenewright.stages.kit.open_words.options import EncoderParameters
from scenewright.stages.kit.open_words.reading.matching import is_layout
from scenewright.stages.kit.open_words.reading.meaning import Meanings
from scenewright.stages.kit.stage import Parameters
from scenewright.stages.splat import recall_at_rejection
from scenewright.stages.splat.asked_figures import REJECTED

from benchmarks.experiment import Bench, Experiment, Measure, Trial
from benchmarks.generated_rooms import STEPS
from benchmarks.steps import made, opened
from benchmarks.words.asked import NAMED_ROOMS, AskedRoom, Query

CASE = "rooms"


class RelationParameters(Parameters):
    """Options of the experiment."""

    rooms: int = Field(8, ge=1, le=8, description="So many of the rooms")
    frames: int = Field(24, ge=8, description="Frames of a room")


@dataclass(frozen=True)
class RoomTold:
    """What came of a room."""

    chances: tuple[float, ...]
    """Probabilities of the first places of texts for things that are there ..."""
    hits: tuple[bool, ...]
    """... and whether they are right."""
    absent: tuple[float, ...]
    """Probabilities of the first places of texts for what is not."""
    relations: int
    """Phrases "noun on the noun"."""
    parts_found: int
    """Of those: both nouns, asked alone, have a first place that is right."""
    right: int
    """Of these: the first place of the phrase is a thing that truly stands on such a one."""


def finder_of(room: AskedRoom, meanings: Meanings) -> Finder:
    """Return a finder of a room's mapped entities that hears names alone."""
    given = ("--panoptic-map", room.map, "--sequence", room.sequence.root, "--most-views", room.most_views)
    labels = opened(LanguageMap, made("splat label", room.folder / "map_labels", *given))
    finder = Finder(labels, open_encoder(EncoderParameters.model_validate({}), None), meanings=meanings)
    finder.is_strange = True
    return finder


def pairs_of(room: AskedRoom) -> dict[tuple[str, str], tuple[set[int], set[int]]]:
    """Return (noun, noun) -> the instances of the first that stand on one of the second, and those of the second."""
    graph = room.truth.graph
    node = {each.id: each for each in graph.nodes}
    found: dict[tuple[str, str], tuple[set[int], set[int]]] = {}
    for link in graph.links:
        above, below = node[link.source], node[link.target]
        if link.relation in TREE_RELATIONS and above.instance and not is_layout(above.class_name):
            key = (below.class_name.replace("_", " "), above.class_name.replace("_", " "))
            first, second = found.setdefault(key, (set(), set()))
            first.add(below.instance)
            second.add(above.instance)
    return found


def first_right(room: AskedRoom, finder: Finder, places: Sequence[Found], right: set[int]) -> bool:
    """Whether the first place lies in the box of one of the right instances."""
    query = Query("", tuple(k for k in right if k in room.boxes))
    return bool(places) and places[0].probability > 0 and room.at(finder.place(places[0].region), query)


def measure(bench: Bench, trials: Sequence[Trial]) -> Iterator[tuple[Trial, RoomTold]]:
    """Ask a room."""
    meanings = Meanings()
    for trial in trials:
        room = AskedRoom(bench.out / CASE, trial.seed, 0, bench.parameters.frames)
        finder = finder_of(room, meanings)
        firsts = [[first_of(room, finder, query) for query in queries] for queries in room.queries]
        graph = opened(ContactGraph, made("graph", room.folder / "graph", "--panoptic-map", room.map)).info
        found = right = 0
        pairs = pairs_of(room)
        for (noun, other), (first, second) in sorted(pairs.items()):
            phrase = heard(f"{noun} on the {other}")
            assert phrase is not None and phrase.other is not None
            alone = [(finder.find(noun, heard(noun)), first), (finder.find(other, heard(other)), second)]
            if all(first_right(room, finder, places, instances) for places, instances in alone):
                found += 1
                right += first_right(room, finder, finder.find_related(phrase, graph), first)
        yield (
            trial,
            RoomTold(
                tuple(round(p, 4) for p, _ in firsts[0]),
                tuple(hit for _, hit in firsts[0]),
                tuple(round(p, 4) for p, _ in firsts[1]),
                len(pairs),
                found,
                right,
            ),
        )


def first_of(room: AskedRoom, finder: Finder, query: Query) -> tuple[float, bool]:
    """Return the probability of the first place of a text, and whether it is right."""
    phrase = heard(query.text)
    places = finder.find(query.text, phrase) if phrase is not None else []
    return (places[0].probability, room.at(finder.place(places[0].region), query)) if places else (0.0, False)


def threshold_of(records: Sequence[RoomTold]) -> float | None:
    """Return the probability under which nine of ten absent texts lie."""
    absent = [chance for record in records for chance in record.absent]
    return float(np.quantile(absent, REJECTED)) if absent else None


def recall_of(records: Sequence[RoomTold]) -> float | None:
    """Return the share of things found from that threshold on."""
    present, absent = ([p for r in records for p in getattr(r, name)] for name in ("chances", "absent"))
    hits = np.array([hit for record in records for hit in record.hits], bool)
    return recall_at_rejection(np.array(present), hits, np.array(absent))


EXPERIMENT = Experiment(
    name="words_relations",
    title="Generated rooms asked by names alone",
    simulated="The rooms, their images and noisy depth.",
    knows="Colour, depth and exact poses; our own network, trained on other rooms of the same generators.",
    does_not_show="Fresh rooms: the encoder's probabilities were fitted on these. Relations but on.",
    arms={"ours": "ours, by names alone"},
    cases=(CASE,),
    seeds_of=lambda bench, case: NAMED_ROOMS[: bench.parameters.rooms],
    tuning=NAMED_ROOMS,
    measure=measure,
    record=RoomTold,
    measures={
        "recall_at_rejection": Measure(recall_of),
        "threshold": Measure(threshold_of, interval=False),
        "parts_found": Measure(lambda records: float(sum(r.parts_found for r in records)), interval=False),
        "phrases": Measure(lambda records: float(sum(r.relations for r in records)), interval=False),
        "relations_right": Measure(
            lambda records: sum(r.right for r in records) / n if (n := sum(r.parts_found for r in records)) else None
        ),
    },
    parameters=RelationParameters,
    quick={"rooms": 2},
    steps=(*STEPS, "segment", "fuse", "graph", "splat label"),
)
