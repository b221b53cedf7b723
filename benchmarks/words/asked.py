"""Places that are asked: the artifacts of each arm, and queries with their right answers by a stated rule.

A generated room is asked for 15 things that are there and 15 that are not. There: things are drawn from those that at
least 300 pixels of the log show, and called by a noun or, every second time, by colour and noun, until 15 texts differ.
Not there: a phrase of any class of the lexicon that is false of everything in the room. No phrase is held out from the
encoder's training here: what it makes of such words is in its own figures. A real log is asked for every noun of the
classes that somebody boxed in it (data/annotations/real), and for one noun of each class that its annotation does not
name.
"""

from __future__ import annotations

import shutil
from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from scenewright.schemas.cad_library import CadLibrary
from scenewright.schemas.ground_truth import GroundTruth
from scenewright.schemas.language_map import LanguageMap, LanguageRegion
from scenewright.schemas.scene_parts import Box, Camera
from scenewright.schemas.sequence import Sequence
from scenewright.schemas.splat import Splat
from scenewright.schemas.vocabulary import load_vocabulary
from scenewright.stages.kit.formats.frames import FrameReader
from scenewright.stages.kit.geometry.boxes import minimum_box, points_in_box, upright_box
from scenewright.stages.kit.geometry.cameras import back_project
from scenewright.stages.kit.geometry.transforms import apply, inverse
from scenewright.stages.kit.open_words.answering import members_of
from scenewright.stages.kit.open_words.vectors import read_vectors
from scenewright.stages.splat import MARGIN, PosedView, Sight, evenly, lexicon, no_strays, posed_frames, read_view
from scenewright.stages.splat.training.words.lexicon import FALSE, TRUE, Phrase, Thing, truth_of
from scenewright.stages.truth import instances_of, read_support_annotation

from benchmarks.board.real import ANNOTATIONS
from benchmarks.generated_rooms import RoomFolder, make_room
from benchmarks.perfect_maps import perfect_map
from benchmarks.steps import made, opened, unrecorded
from benchmarks.words.gathering import thing_of

NAMED_ROOMS = tuple(f"{kind}-{1520 + k}" for k, kind in enumerate(2 * ("kitchen", "office", "bedroom", "room")))
"""Reported on once, and tuning rooms since: our network has learned from none of them."""
SIZE = (320, 240)
QUERIES = 15
LEAST_PIXELS = 300


@dataclass(frozen=True)
class Query:
    """A text, and the instances it is true of; none where the room has none."""

    text: str
    right: tuple[int, ...]


@dataclass(frozen=True)
class Labelled:
    """A held-out frame with what its pixels show."""

    labels: np.ndarray
    """(H, W) instances, 0 none."""
    camera: Camera
    camera_from_world: np.ndarray


class AskedPlace(ABC):
    """A place with what every arm asks. Everything is made when it is first needed, and kept."""

    most_views: int
    """Pictures that are read for language."""
    splat_options: tuple[object, ...]

    def __init__(self, root: Path, name: str, steps: int) -> None:
        self.root, self.name, self.steps = root, name, steps

    @property
    @abstractmethod
    def folder(self) -> Path:
        """Where its artifacts stand."""

    @property
    @abstractmethod
    def sequence(self) -> Sequence:
        """Its log."""

    @cached_property
    def map(self) -> Path | None:
        """Our panoptic map of it, whose entities name the pieces of the splat; None: there is none."""
        return None

    @property
    @abstractmethod
    def boxes(self) -> dict[int, Box]:
        """Of its things, by instance."""

    @property
    @abstractmethod
    def queries(self) -> tuple[list[Query], list[Query]]:
        """Return those for things that are there, and those for things that are not."""

    @abstractmethod
    def labelled(self, frames: set[int]) -> dict[int, Labelled]:
        """Return what frames show."""

    @cached_property
    def splat(self) -> Splat:
        """Learned from five of six pictures."""
        given = ("--sequence", self.sequence.root, *self.splat_options)
        return opened(Splat, made("splat build", self.folder / "splat", *given))

    @cached_property
    def language(self) -> LanguageMap:
        """Language in the splat."""
        given = ("--splat", self.splat.root, "--sequence", self.sequence.root, "--steps", self.steps)
        few = ("--most-views", self.most_views)
        named = () if self.map is None else ("--panoptic-map", self.map)
        return opened(LanguageMap, made("splat language", self.folder / "language", *given, *few, *named))

    @cached_property
    def nameless(self) -> LanguageMap:
        """The same language without what the map says: pieces have no classes, and boxes of their own."""
        vectors, info = read_vectors(self.language), self.language.info
        order, starts = members_of(vectors.pieces, len(info.regions))
        members = [vectors.means[part].astype(float) for part in np.split(order, starts[1:-1])]
        regions = tuple(
            LanguageRegion(box=minimum_box(points[no_strays(points)]), looks=region.looks)
            for points, region in zip(members, info.regions, strict=True)
        )
        target = self.folder / "nameless"
        target.mkdir(exist_ok=True)
        shutil.copy(self.language.path("vectors.npz"), target)
        info.model_copy(update={"regions": regions}).write(target / "language.json")
        return LanguageMap(target, outcome="ok", summary={})

    @cached_property
    def pictures(self) -> list[tuple[PosedView, Sight]]:
        """Those that are read for language, twice."""
        learned = [view.frame for view in self.splat.built.views if view.use == "learned"]
        found = []
        with FrameReader(self.sequence.path("frames.mcap")) as reader:
            poses = dict(posed_frames(reader, self.sequence, None))
            for frame in evenly(learned, self.most_views):
                read, view = reader.read(frame, ("color", "depth")), read_view(reader, frame, poses[frame], SIZE[0])
                if view is not None and read.color is not None and read.depth is not None:
                    camera = reader.cameras[read.camera_name]
                    found.append((view, Sight(read.color, read.depth, camera, view.camera_from_world)))
        return found

    @cached_property
    def sights(self) -> dict[int, Labelled]:
        """Held-out frames."""
        return self.labelled({view.frame for view in self.splat.built.views if view.use == "held_out"})

    def at(self, point: np.ndarray, query: Query) -> bool:
        """Whether a place [m] lies in the box of a right thing."""
        return any(bool(points_in_box(self.boxes[k], point[None], MARGIN)[0]) for k in query.right)

    def best_view(self, query: Query) -> int | None:
        """Return the held-out frame that shows most of a right thing; None where none shows any."""
        counts = {frame: int(np.isin(sight.labels, query.right).sum()) for frame, sight in self.sights.items()}
        best = max(counts, key=lambda frame: counts[frame], default=None)
        return best if best is not None and counts[best] > 0 else None

    def within_picture(self, point: np.ndarray, query: Query) -> bool | None:
        """Whether a place, projected into the best held-out view, falls into the picture's box of a right thing (the
        thesis's rule); None where no held-out view shows one."""
        frame = self.best_view(query)
        if frame is None:
            return None
        shown = self.sights[frame]
        camera, pose = shown.camera, shown.camera_from_world
        local = pose[:3, :3] @ point + pose[:3, 3]
        if local[2] <= 0:
            return False
        column, row = camera.fx * local[0] / local[2] + camera.cx, camera.fy * local[1] / local[2] + camera.cy
        for instance in query.right:
            rows, columns = np.nonzero(shown.labels == instance)
            if len(rows) and rows.min() <= row <= rows.max() and columns.min() <= column <= columns.max():
                return True
        return False


class AskedRoom(AskedPlace):
    """A generated room."""

    most_views = 12
    splat_options = ("--width", 160, "--steps", 100, "--steps-per-second", 1, "--hold-out-every", 6)

    def __init__(self, root: Path, name: str, steps: int, frames: int, rearranged: int = 0) -> None:
        super().__init__(root, name, steps)
        self.frames, self.rearranged = frames, rearranged

    @cached_property
    def room(self) -> RoomFolder:
        """The room's log and truth."""
        return make_room(self.root, self.name, self.frames, size=SIZE, rearranged=self.rearranged)

    @property
    def folder(self) -> Path:
        return self.room.folder

    @cached_property
    def sequence(self) -> Sequence:
        return opened(Sequence, self.room.sequence)

    @cached_property
    def map(self) -> Path:
        given = ("--sequence", self.sequence.root)
        segments = made("segment", self.folder / "segments", *given)
        return made("fuse", self.folder / "map", *given, "--segments", segments)

    @cached_property
    def truth(self) -> GroundTruth:
        """What is true of it."""
        return opened(GroundTruth, self.room.ground_truth)

    @cached_property
    def entities(self) -> LanguageMap:
        """Labels of a perfect map: the true surface that was seen, with true entities."""
        target = self.folder / "labels"
        if target.exists():
            shutil.rmtree(target)
        panoptic = perfect_map(self.truth, self.folder / "perfect")
        few = {"most_views": self.most_views}
        return unrecorded("splat label", target, few, panoptic_map=panoptic, sequence=self.sequence)

    @cached_property
    def boxes(self) -> dict[int, Box]:
        return {entry.instance: entry.box for entry in self.truth.info.objects}

    @cached_property
    def queries(self) -> tuple[list[Query], list[Query]]:
        library = opened(CadLibrary, self.root / "cad_library")
        models, words = {model.id: model for model in library.info.models}, lexicon()
        number = int(self.name.rsplit("-", 1)[1])
        random = np.random.default_rng([number, 23])
        entries = list(self.truth.info.objects)
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

    def labelled(self, frames: set[int]) -> dict[int, Labelled]:
        found = {}
        with FrameReader(self.truth.path("log.mcap")) as reader:
            for index in sorted(frames):
                frame = reader.read(index, ("labels",))
                assert frame.labels is not None and frame.world_from_camera is not None
                found[index] = Labelled(frame.labels, self.truth.info.camera, inverse(frame.world_from_camera))
        return found


class AskedLog(AskedPlace):
    """A real log in which somebody boxed things."""

    most_views = 40
    splat_options = ("--width", 320, "--steps", 600, "--steps-per-second", 0, "--hold-out-every", 6, "--most-views", 90)

    def __init__(self, root: Path, name: str, steps: int, log: Path, every: int) -> None:
        super().__init__(root, name, steps)
        self.log, self.every = log, every
        self.told = read_support_annotation(ANNOTATIONS / f"{name}.json")

    @property
    def folder(self) -> Path:
        return self.root / self.name

    @cached_property
    def sequence(self) -> Sequence:
        given = ("--log", self.log, "--every", self.every)
        return opened(Sequence, made("ingest", self.folder / "sequence", *given))

    @cached_property
    def boxes(self) -> dict[int, Box]:
        found = {k: node.find.box for k, node in enumerate(self.told.nodes, 1)}
        return {k: upright_box(box) for k, box in found.items() if box is not None}

    @cached_property
    def queries(self) -> tuple[list[Query], list[Query]]:
        words, layout = lexicon(), {entry.name for entry in load_vocabulary().classes if entry.is_layout}
        rows = np.stack([words.row(Thing(node.class_name)) for node in self.told.nodes])
        said = self.told.model_dump_json().lower()
        present, absent = [], []
        for name in words.classes:
            number = words.number["class", name]
            nouns = words.nouns(number)
            fits = truth_of(rows, [Phrase(name, (number,))])[:, 0]
            if (fits == TRUE).any():
                right = tuple(int(k) + 1 for k in np.flatnonzero(fits != FALSE))
                present += [Query(noun, right) for noun in nouns if name not in layout]
            elif (fits == FALSE).all() and name not in layout and not any(noun in said for noun in nouns):
                absent.append(Query(nouns[0], ()))
        return present, absent

    def labelled(self, frames: set[int]) -> dict[int, Labelled]:
        found = {}
        with FrameReader(self.sequence.path("frames.mcap")) as reader:
            poses = dict(posed_frames(reader, self.sequence, None))
            for index in sorted(frames):
                frame = reader.read(index, ("depth",))
                assert frame.depth is not None
                camera = reader.cameras[frame.camera_name]
                points = apply(poses[index], back_project(frame.depth, camera).reshape(-1, 3).astype(float))
                _, owner = instances_of(self.told, points, np.zeros(len(points), np.int64), None, 0.0)
                labels = np.where(frame.depth > 0, owner.reshape(frame.depth.shape), 0)
                found[index] = Labelled(labels, camera, inverse(poses[index]))
        return found
