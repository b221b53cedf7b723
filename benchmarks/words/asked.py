"""Generated rooms that are asked: the artifacts of each arm, and queries with their right answers by a stated rule.

A room is asked for 15 things that are there and 15 that are not. There: things are drawn from those that at least 300
pixels of the log show, and called by a noun or, every second time, by colour and noun, until 15 texts differ. Not
there: a phrase of any class of the lexicon that is false of everything in the room. No phrase is held out
from the encoder's training here: what it makes of such words is in its own figures.
"""

from __future__ import annotations

import shutil
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from benchmarks.generated_rooms import RoomFolder, make_room
from benchmarks.perfect_maps import perfect_map
from benchmarks.steps import made, opened, unrecorded
from benchmarks.words.gathering import thing_of
from benchmarks.words.lexicon import FALSE, TRUE, Phrase, Thing, lexicon, truth_of
from schemas.cad_library import CadLibrary
from schemas.ground_truth import GroundTruth, TrueObject
from schemas.language_map import LanguageMap
from schemas.sequence import Sequence
from schemas.splat import Splat
from stages.kit.formats.frames import FrameReader
from stages.kit.geometry.boxes import points_in_box
from stages.kit.geometry.transforms import inverse
from stages.splat.language.looks import Sight
from stages.splat.views import PosedView, evenly, posed_frames, read_view

SIZE = (320, 240)
QUERIES = 15
LEAST_PIXELS = 300
MARGIN = 0.02
"""A place is at a thing when it lies within its box grown by this on every side [m]."""
SPLAT = ("--width", 160, "--steps", 100, "--steps-per-second", 1, "--hold-out-every", 6)
VIEWS = 12
"""Pictures that are read for language."""


@dataclass(frozen=True)
class Query:
    """A text, and the instances it is true of; none where the room has none."""

    text: str
    right: tuple[int, ...]


class AskedRoom:
    """A room with what every arm asks. Everything is made when it is first needed, and kept."""

    def __init__(self, root: Path, name: str, frames: int, steps: int) -> None:
        self.root, self.name, self.frames, self.steps = root, name, frames, steps

    @cached_property
    def room(self) -> RoomFolder:
        """The room's log and truth."""
        return make_room(self.root, self.name, self.frames, size=SIZE)

    @cached_property
    def truth(self) -> GroundTruth:
        """What is true of it."""
        return opened(GroundTruth, self.room.ground_truth)

    @cached_property
    def splat(self) -> Splat:
        """Learned from five of six pictures."""
        out = self.room.folder / "splat"
        return opened(Splat, made("splat build", out, "--sequence", self.room.sequence, *SPLAT))

    @cached_property
    def language(self) -> LanguageMap:
        """Language in the splat."""
        given = ("--splat", self.splat.root, "--sequence", self.room.sequence, "--steps", self.steps)
        few = ("--most-views", VIEWS)
        return opened(LanguageMap, made("splat language", self.room.folder / "language", *given, *few))

    @cached_property
    def entities(self) -> LanguageMap:
        """Labels of a perfect map: the true surface that was seen, with true entities."""
        target = self.room.folder / "labels"
        if target.exists():
            shutil.rmtree(target)
        panoptic = perfect_map(self.truth, self.room.folder / "perfect")
        sequence = opened(Sequence, self.room.sequence)
        return unrecorded("splat label", target, {"most_views": VIEWS}, panoptic_map=panoptic, sequence=sequence)

    @cached_property
    def pictures(self) -> list[tuple[PosedView, Sight]]:
        """Those that are read for language, twice."""
        sequence = opened(Sequence, self.room.sequence)
        learned = [view.frame for view in self.splat.built.views if view.use == "learned"]
        found = []
        with FrameReader(sequence.path("frames.mcap")) as reader:
            poses = dict(posed_frames(reader, sequence, None))
            for frame in evenly(learned, VIEWS):
                read, view = reader.read(frame, ("color", "depth")), read_view(reader, frame, poses[frame], SIZE[0])
                if view is not None and read.color is not None and read.depth is not None:
                    found.append((view, Sight(read.color, read.depth, view.camera, view.camera_from_world)))
        return found

    @cached_property
    def objects(self) -> dict[int, TrueObject]:
        """Things by instance."""
        return {entry.instance: entry for entry in self.truth.info.objects}

    @cached_property
    def queries(self) -> tuple[list[Query], list[Query]]:
        """Return those for things that are there, and those for things that are not."""
        library = opened(CadLibrary, self.root / "cad_library")
        models, words = {model.id: model for model in library.info.models}, lexicon()
        number = int(self.name.rsplit("-", 1)[1])
        random = np.random.default_rng([number, 23])
        entries = list(self.objects.values())
        rows = np.stack([words.row(thing_of(entry, library, models)) for entry in entries])
        seen = [k for k, entry in enumerate(entries) if entry.visible_pixels >= LEAST_PIXELS]

        def right(phrase: Phrase) -> tuple[int, ...]:
            fits = truth_of(rows, [phrase])[:, 0]
            return tuple(entries[k].instance for k in np.flatnonzero(fits != FALSE))

        present: dict[str, Query] = {}
        for turn in range(20 * QUERIES):
            row = rows[seen[int(random.integers(len(seen)))]]
            phrase = self._phrase(row, bool(turn % 2), random)
            if phrase is not None and phrase.text not in present and len(present) < QUERIES:
                present[phrase.text] = Query(phrase.text, right(phrase))
        absent: dict[str, Query] = {}
        for turn in range(40 * QUERIES):
            name = words.classes[int(random.integers(len(words.classes)))]
            color = str(random.choice(words.table["colors"]))
            row = words.row(Thing(name, "", ((color, 1.0),), 0.0))
            phrase = self._phrase(row, bool(turn % 2), random)
            if phrase is not None and not right(phrase) and len(absent) < QUERIES:
                absent[phrase.text] = Query(phrase.text, ())
        return list(present.values()), list(absent.values())

    @staticmethod
    def _phrase(row: np.ndarray, colored: bool, random: np.random.Generator) -> Phrase | None:
        words = lexicon()
        of = {
            kind: [k for k, (each, _) in enumerate(words.attributes) if each == kind and row[k] == TRUE]
            for kind in ("class", "color")
        }
        noun = of["class"][0]
        text = str(random.choice(words.nouns(noun)))
        phrase = Phrase(text, (noun,))
        if colored and of["color"]:
            color = of["color"][0]
            phrase = Phrase(f"{words.adjectives(color)[0]} {text}", (color, noun))
        return None if words.is_held_phrase(phrase) else phrase

    def at(self, point: np.ndarray, query: Query) -> bool:
        """Whether a place [m] lies in the box of a right thing."""
        return any(bool(points_in_box(self.objects[k].box, point[None], MARGIN)[0]) for k in query.right)

    @cached_property
    def sights(self) -> dict[int, tuple[np.ndarray, np.ndarray]]:
        """Held-out frames: (labels (H, W), camera_from_world)."""
        held = {view.frame for view in self.splat.built.views if view.use == "held_out"}
        found = {}
        with FrameReader(self.truth.path("log.mcap")) as reader:
            for index in sorted(held):
                frame = reader.read(index, ("labels",))
                assert frame.labels is not None and frame.world_from_camera is not None
                found[index] = (frame.labels, inverse(frame.world_from_camera))
        return found

    def best_view(self, query: Query) -> int | None:
        """Return the held-out frame that shows most of a right thing; None where none shows any."""
        counts = {frame: int(np.isin(labels, query.right).sum()) for frame, (labels, _) in self.sights.items()}
        best = max(counts, key=lambda frame: counts[frame], default=None)
        return best if best is not None and counts[best] > 0 else None

    def within_picture(self, point: np.ndarray, query: Query) -> bool | None:
        """Whether a place, projected into the best held-out view, falls into the picture's box of a right thing (the
        thesis's rule); None where no held-out view shows one."""
        frame = self.best_view(query)
        if frame is None:
            return None
        labels, pose = self.sights[frame]
        camera, local = self.truth.info.camera, pose[:3, :3] @ point + pose[:3, 3]
        if local[2] <= 0:
            return False
        column, row = camera.fx * local[0] / local[2] + camera.cx, camera.fy * local[1] / local[2] + camera.cy
        for instance in query.right:
            rows, columns = np.nonzero(labels == instance)
            if len(rows) and rows.min() <= row <= rows.max() and columns.min() <= column <= columns.max():
                return True
        return False
