"""The asked places that `scenewright train word-probabilities` reads: tuning rooms, and real logs that were looked at.

python -m benchmarks.words.asking --out FOLDER [--data FOLDER] [--quick]
"""

from __future__ import annotations

from pathlib import Path

from pydantic import Field
from scenewright.schemas.language_map import LanguageMap
from scenewright.stages.kit.open_words.calibration import NAMED_SPLAT
from scenewright.stages.kit.open_words.embedded import EmbeddedEncoder
from scenewright.stages.kit.open_words.finding import Finder
from scenewright.stages.splat.training.word_probabilities import asked_places

from benchmarks.board.real import LOGS
from benchmarks.options import Recipe, asked
from benchmarks.words.asked import NAMED_ROOMS, AskedLog, AskedPlace, AskedRoom

ROOMS = {
    "splat": ("kitchen-40", "office-41"),
    "panoptic_map": ("kitchen-40", "office-41", "bedroom-42", "room-43"),
    NAMED_SPLAT: NAMED_ROOMS,
}
LANGUAGE_OF = {"splat": "nameless", "panoptic_map": "entities", NAMED_SPLAT: "language"}
LOOKED_AT = ("kitchen", "office")
"""Real logs that were looked at."""


class Options(Recipe):
    """Options."""

    data: Path = Field(Path("../shared/data"), description="Folder with the real logs")
    frames: int = Field(24, description="Frames of a room")
    steps: int = Field(200, description="Steps of the field")


def room_of(options: Options, name: str) -> AskedRoom:
    """Return a generated room."""
    return AskedRoom(options.out / "rooms", name, options.steps, options.frames)


def log_of(options: Options, name: str) -> AskedLog:
    """Return a real log."""
    log = LOGS[name].within(options.data)
    return AskedLog(options.out / "logs", name, options.steps, log.path, log.every)


def answered(use: str, place: AskedPlace, language: LanguageMap) -> asked_places.AskedPlace:
    """Return a place with the right answers to all its queries."""
    finder = Finder(language, EmbeddedEncoder())
    regions = [finder.place(k) for k in range(len(finder.info.regions))]
    queries = (*place.queries[0], *place.queries[1])
    rights = [tuple(place.at(region, query) for region in regions) for query in queries]
    found = tuple(asked_places.Asked(query.text, right) for query, right in zip(queries, rights, strict=True))
    return asked_places.AskedPlace(use, language, found)


def main() -> None:
    """Ask all places."""
    options = asked(Options)
    few = 1 if options.quick else None
    known = [room_of(options, name) for name in ROOMS["splat"][:few]]
    logs = [log_of(options, name) for name in LOOKED_AT[:few]]
    found = [answered(asked_places.KNOWN, room, room.language) for room in known]
    found += [answered(asked_places.STRANGE, log, log.language) for log in logs]
    for source, names in ROOMS.items():
        rooms = [room_of(options, name) for name in names[:few]]
        found += [answered(source, room, getattr(room, LANGUAGE_OF[source])) for room in rooms]
    asked_places.write_places(options.out, found)


if __name__ == "__main__":
    main()
