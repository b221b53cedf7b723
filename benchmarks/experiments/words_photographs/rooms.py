"""`python -m benchmarks.experiments.words_photographs.rooms --out FOLDER`: the threshold of `ours`.

Rooms on which the encoder's probabilities were fitted too. Their maps are of our own network's masks. Entities are
asked by names alone, as in recorded rooms, for the texts that generated rooms are asked. The threshold is that at which
nine of ten absent texts are rejected.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import numpy as np
from scenewright.schemas.contact_graph import ContactGraph
from scenewright.schemas.language_map import LanguageMap
from scenewright.stages.kit.open_words.finding import Finder, heard
from scenewright.stages.kit.open_words.opening import open_encoder
from scenewright.stages.kit.open_words.options import EncoderParameters
from scenewright.stages.kit.open_words.reading.meaning import Meanings
from scenewright.stages.kit.open_words.reading.sentences import SentenceEncoder, installed_sentences
from scenewright.stages.splat.asked_figures import REJECTED

from benchmarks.steps import made, opened
from benchmarks.words.asked import NAMED_ROOMS, AskedRoom

STEPS = 200


def finder_of(room: AskedRoom, meanings: Meanings) -> Finder:
    """Return a finder of a room's mapped entities that hears names alone."""
    given = ("--panoptic-map", room.map, "--sequence", room.sequence.root, "--most-views", room.most_views)
    labels = opened(LanguageMap, made("splat label", room.folder / "map_labels", *given))
    finder = Finder(labels, open_encoder(EncoderParameters.model_validate({}), None), meanings=meanings)
    finder.is_strange = True
    return finder


def graph_of(room: AskedRoom) -> ContactGraph:
    """Return the contact graph of a room's map."""
    return opened(ContactGraph, made("graph", room.folder / "graph", "--panoptic-map", room.map))


def chances(room: AskedRoom, finder: Finder) -> tuple[list[float], list[bool], list[float]]:
    """Return the probabilities of the first places of present texts, whether they are right, and those of absent."""
    present, absent = room.queries
    firsts = []
    for query in (*present, *absent):
        phrase = heard(query.text)
        found = finder.find(query.text, phrase) if phrase is not None else []
        firsts.append((found[0].probability, room.at(finder.place(found[0].region), query)) if found else (0.0, False))
    count = len(present)
    return [p for p, _ in firsts[:count]], [hit for _, hit in firsts[:count]], [p for p, _ in firsts[count:]]


def main(out: Path, rooms: int) -> None:
    """Print the threshold and what is found from it on."""
    folder = installed_sentences()
    meanings = Meanings(SentenceEncoder(folder) if folder is not None else None)
    present, right, absent = [], [], []
    for name in NAMED_ROOMS[:rooms]:
        room = AskedRoom(out / "rooms", name, STEPS, 24)
        for total, part in zip((present, right, absent), chances(room, finder_of(room, meanings)), strict=True):
            total.extend(part)  # type: ignore[arg-type]
    threshold = float(np.quantile(absent, REJECTED))
    found = float(np.mean(np.array(right) & (np.array(present) > threshold)))
    row = {"threshold": round(threshold, 3), "rooms": rooms, "present": len(present), "absent": len(absent)}
    print(json.dumps(row | {"found": round(found, 3), "layers": meanings.layers()}))


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--rooms", type=int, default=4)
    given = parser.parse_args()
    main(given.out, given.rooms)
