"""Rooms that are asked: language in a splat (`ours`), the thesis's way to an answer, entities of a perfect map.

Cases: `rooms`, generated; `rearranged`, the same with other things on their furniture, elsewhere; the real
logs of data/annotations/real, asked for what somebody boxed there.

The same pictures and poses; `ours`, `pieces` and `thesis` ask the same field. In `ours` our map names the pieces of the
splat, in `pieces` nothing does. The map is what `segment` and `fuse` make of all pictures of the room's log; in real
logs there is none, as our network knows no photographs. `thesis` takes the size that fits best in the view in which a
right thing is seen best (the user's choice there), then the Gaussian that fits best at that size, and always answers.
`langsplat` is asked the same way, of its three levels instead of sizes; `lerf` in the same view, along rays. `entities`
asks what pictures show of every entity of a perfect map, which generated rooms have: more than our map would be.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np
from pydantic import Field
from scenewright.schemas.language_map import LanguageMap
from scenewright.stages.kit.geometry.boxes import box_iou
from scenewright.stages.kit.geometry.cameras import scaled
from scenewright.stages.kit.open_words.calibration import BUNDLED as CALIBRATION
from scenewright.stages.kit.open_words.embedded import BUNDLED as ENCODER
from scenewright.stages.kit.open_words.finding import Finder
from scenewright.stages.kit.open_words.opening import open_encoder
from scenewright.stages.kit.open_words.options import EncoderParameters
from scenewright.stages.kit.open_words.relevancy import margins, query_rows, relevancy
from scenewright.stages.kit.rendering.splatting.compiled import CompiledRasterizer
from scenewright.stages.kit.rendering.splatting.rasterizer import View
from scenewright.stages.kit.stage import Parameters
from scenewright.stages.splat import calibration_error, read_gaussians, recall_at_rejection
from scenewright.stages.splat.language.pyramid import pyramid

from benchmarks.board.real import ANNOTATED, ANNOTATIONS, LOGS
from benchmarks.experiment import Bench, Experiment, Measure, Trial
from benchmarks.generated_rooms import STEPS
from benchmarks.splats.langsplat import langsplat
from benchmarks.splats.lerf import Lerf
from benchmarks.words.asked import NAMED_ROOMS, AskedLog, AskedPlace, AskedRoom, Query

SEEDS = tuple(
    f"{recipe}-{seed}" for seed, recipe in enumerate(("kitchen", "office", "bedroom", "room") * 5, start=1540)
)
"""Measured before: they are not fresh."""
TUNING = NAMED_ROOMS
"""The probabilities were fitted on them too, and our network has not learned from them."""
GENERATED, REARRANGED = "rooms", "rearranged"
MADE = (GENERATED, REARRANGED)
LEAST = 0.5
"""Probability from which on something is an answer: one for all rooms."""
BOX_OVERLAP = 0.25
RENDERED_WIDTH, LERF_WIDTH = 160, 64
"""Of the pictures that `thesis` and `langsplat`, and `lerf`, are asked in [px]."""
LERF_SIDES = (0.05, 0.5)
"""Of its squares, over the height."""


class WordsParameters(Parameters):
    """Options of the experiment."""

    data: Path = Field(Path("../shared/data"), description="Folder with the real logs")
    frames: int = Field(24, ge=8, description="Frames of a room")
    steps: int = Field(200, ge=1, description="Steps of training the field")
    lerf_steps: int = Field(300, ge=1, description="Steps of training LERF")
    rooms: int = Field(20, ge=1, le=20, description="So many of the rooms")


@dataclass(frozen=True)
class Asked:
    """What came of a room's queries."""

    present: int
    in_box: int
    """Queries whose first answer lies in the 3-D box of a right thing."""
    overlapping: int
    """... and has a box that overlaps with it."""
    shown: int
    in_picture: int
    """Of those whose thing a held-out view shows (`shown`), first answers within its box there."""
    answers: int
    right_answers: int
    """Of all answers to queries for things that are there."""
    absent: int
    rejected: int
    chances: tuple[float, ...]
    """Probabilities of the first place, answer or not, of every query ..."""
    hits: tuple[bool, ...]
    """... and whether it was right."""
    query_ms: float
    """Median [ms], processor time."""
    gaussians: int


@dataclass(frozen=True)
class Place:
    """One answer."""

    point: np.ndarray
    probability: float
    overlaps: bool


def measure(bench: Bench, trials: Sequence[Trial]) -> Iterator[tuple[Trial, Asked]]:
    """Ask a room in every arm."""
    trial = trials[0]
    given = bench.parameters
    room: AskedPlace
    if trial.case in MADE:
        room = AskedRoom(bench.out / trial.case, trial.seed, given.steps, given.frames, int(trial.case == REARRANGED))
    else:
        log = LOGS[trial.case].within(given.data)
        room = AskedLog(bench.out, trial.case, given.steps, log.path, log.every)
    for trial in trials:
        yield trial, asked(room, trial.arm, given.lerf_steps)


def asked(room: AskedPlace, arm: str, lerf_steps: int) -> Asked:
    """Return what an arm makes of a room's queries."""
    encoder = open_encoder(EncoderParameters.model_validate({}), None)
    language = language_of(room, arm)
    finder = Finder(language, encoder)
    always = always_answering(room, finder, arm, lerf_steps)
    present, absent = room.queries
    found: dict[str, list[Place]] = {}
    times = []
    for query in (*present, *absent):
        began = time.process_time()
        found[query.text] = always.find(query) if always is not None else places(room, finder, query)
        times.append(1e3 * (time.process_time() - began))
    least = LEAST if always is None else 0.0
    first = [next(iter(found[query.text]), None) for query in present]
    answered = [place if place is not None and place.probability >= least else None for place in first]
    hits = [place is not None and room.at(place.point, query) for place, query in zip(answered, present, strict=True)]
    pictured = [
        place is not None and room.within_picture(place.point, query)
        for place, query in zip(answered, present, strict=True)
    ]
    kept = [(place, query) for query in present for place in found[query.text] if place.probability >= least]
    firsts = [(next(iter(found[query.text]), None), query) for query in (*present, *absent)]
    return Asked(
        present=len(present),
        in_box=sum(hits),
        overlapping=sum(
            hit and place is not None and place.overlaps for hit, place in zip(hits, answered, strict=True)
        ),
        shown=sum(room.best_view(query) is not None for query in present),
        in_picture=sum(bool(each) for each in pictured),
        answers=len(kept),
        right_answers=sum(room.at(place.point, query) for place, query in kept),
        absent=len(absent),
        rejected=sum(all(place.probability < least for place in found[query.text]) for query in absent),
        chances=tuple(round(place.probability, 4) for place, _ in firsts if place is not None),
        hits=tuple(room.at(place.point, query) for place, query in firsts if place is not None),
        query_ms=float(np.median(times)),
        gaussians=0 if arm == "lerf" else finder.info.gaussians,
    )


def language_of(room: AskedPlace, arm: str) -> LanguageMap:
    """Return the language map that an arm asks."""
    if arm == "entities" and isinstance(room, AskedRoom):
        return room.entities
    return room.nameless if arm == "pieces" else room.language


def places(room: AskedPlace, finder: Finder, query: Query) -> list[Place]:
    """Return what a finder answers."""
    result = []
    for found in finder.find(query.text):
        box = finder.info.regions[found.region].box
        overlaps = any(box_iou(box, room.boxes[k]) >= BOX_OVERLAP for k in query.right)
        result.append(Place(finder.place(found.region), found.probability, overlaps))
    return result


class AlwaysAnswering(Protocol):
    """A way to exactly one answer."""

    def find(self, query: Query) -> list[Place]:
        """Return it."""


def always_answering(room: AskedPlace, finder: Finder, arm: str, lerf_steps: int) -> AlwaysAnswering | None:
    """Return the way of an arm that never says that there is none."""
    if arm == "thesis":
        return ThesisWay(room, finder, finder.vectors.vectors)
    if arm == "langsplat":
        sights = [sight for _, sight in room.pictures]
        gaussians = read_gaussians(room.splat.path("splat.ply"))
        return ThesisWay(room, finder, langsplat(gaussians, sights, finder.encoder, CompiledRasterizer()))
    return LerfWay(room, finder, lerf_steps) if arm == "lerf" else None


class LerfWay:
    """One size for a view, the best along its rays; the surface at its pixel that fits best."""

    def __init__(self, room: AskedPlace, finder: Finder, steps: int) -> None:
        self.room, self.finder = room, finder
        pyramids = [pyramid(sight.color, finder.encoder, *LERF_SIDES) for _, sight in room.pictures]
        self.model = Lerf([view for view, _ in room.pictures], 0, pyramids, finder.encoder.width)
        for _ in range(steps):
            self.model.step()
        self.shown: dict[int, tuple[np.ndarray, np.ndarray]] = {}

    def find(self, query: Query) -> list[Place]:
        """Return its one answer."""
        frame = self.room.best_view(query)
        frame = next(iter(self.room.sights)) if frame is None else frame
        if frame not in self.shown:
            sight = self.room.sights[frame]
            camera = scaled(sight.camera, LERF_WIDTH / sight.camera.width)
            self.shown[frame] = self.model.view_vectors(camera, sight.camera_from_world, self.finder.info.sizes)
        vectors, points = self.shown[frame]
        fits = relevancy(margins(vectors, query_rows(self.finder.encoder, query.text)))
        pixel, size = np.unravel_index(int(fits.argmax()), fits.shape)
        return [Place(points[pixel].astype(float), float(fits[pixel, size]), False)]


class ThesisWay:
    """One size for all Gaussians, the best in a rendered view; the Gaussian that fits best at it. `vectors`
    (N, sizes or levels, width)."""

    def __init__(self, room: AskedPlace, finder: Finder, vectors: np.ndarray) -> None:
        self.room, self.finder, self.vectors = room, finder, vectors
        self.gaussians = read_gaussians(room.splat.path("splat.ply"))

    def find(self, query: Query) -> list[Place]:
        """Return its one answer."""
        apart = margins(self.vectors, query_rows(self.finder.encoder, query.text))
        fits = relevancy(apart).astype(np.float32)
        frame = self.room.best_view(query)
        frame = next(iter(self.room.sights)) if frame is None else frame
        arrays = {**self.gaussians.arrays(), "features": fits}
        sight = self.room.sights[frame]
        view = View(scaled(sight.camera, RENDERED_WIDTH / sight.camera.width), sight.camera_from_world)
        shown = CompiledRasterizer().draw(type(self.gaussians)(**arrays), view).picture.features
        size = int(shown.max(axis=(0, 1)).argmax())
        best = int(fits[:, size].argmax())
        return [Place(self.finder.vectors.means[best].astype(float), float(fits[best, size]), False)]


def share(top: str, bottom: str) -> Measure:
    """Pooled share of two counts."""

    def of(records: Sequence[Asked]) -> float | None:
        count = sum(getattr(record, bottom) for record in records)
        return sum(getattr(record, top) for record in records) / count if count else None

    return Measure(of)


def recall_of(records: Sequence[Asked]) -> float | None:
    """Return the share of things found at the one threshold that rejects nine of ten of all absent words."""
    if any(len(record.chances) != record.present + record.absent for record in records):
        return None
    chances = [np.split(np.array(record.chances), [record.present]) for record in records]
    present, absent = (np.concatenate(part) for part in zip(*chances, strict=True))
    hits = np.concatenate([np.array(record.hits[: record.present], bool) for record in records])
    return recall_at_rejection(present, hits, absent)


def calibration_of(records: Sequence[Asked]) -> float | None:
    """Return the expected calibration error of the first places' probabilities."""
    chances = np.array([chance for record in records for chance in record.chances])
    return calibration_error(chances, np.array([hit for record in records for hit in record.hits], float))


def inputs(bench: Bench, trial: Trial) -> list[Path]:
    """What answers are read off: calibration, encoder, and of a real log what somebody boxed."""
    told = [] if trial.case in MADE else [ANNOTATIONS / f"{trial.case}.json"]
    return [CALIBRATION, ENCODER, *told]


def seeds_of(bench: Bench, case: str) -> Sequence[str]:
    """The first rooms, or the one log of that name, where it is there."""
    if case not in MADE:
        return [case] if LOGS[case].within(bench.parameters.data).path.is_dir() else []
    return TUNING if bench.tuning else SEEDS[: bench.parameters.rooms]


EXPERIMENT = Experiment(
    name="legs_words",
    title="Rooms that are asked",
    simulated="The rooms, their pictures and noisy depth; the map of `entities`: the true surface that was seen.",
    knows="Colour, depth and exact poses. `thesis`, `langsplat`, `lerf` are given the view that shows it best.",
    does_not_show=(
        "CLIP or SigLIP: the encoder is ours, small, trained on other rooms of the same generators. SAM, "
        "whose segments LangSplat uses. Words that people choose: these are the encoder's own."
    ),
    arms={
        "ours": "ours",
        "pieces": "ours without a map",
        "thesis": "thesis's method",
        "entities": "entities of a perfect map",
        "langsplat": "LangSplat",
        "lerf": "LERF",
    },
    cases=(*MADE, *ANNOTATED),
    runs=lambda arm, case: arm not in ("entities", "pieces") or case in MADE,
    measure=measure,
    record=Asked,
    measures={
        "recall_3d": share("in_box", "present"),
        "recall_box": share("overlapping", "present"),
        "recall_2d": share("in_picture", "shown"),
        "precision": share("right_answers", "answers"),
        "absent_rejected": share("rejected", "absent"),
        "recall_at_rejection": Measure(recall_of),
        "calibration_error": Measure(calibration_of),
        "query_ms": Measure(lambda records: float(np.median([record.query_ms for record in records])), "ms", False),
        "gaussians": Measure(lambda records: float(np.mean([record.gaussians for record in records])), "", False),
    },
    tuning=TUNING,
    reporting=SEEDS,
    seeds_of=seeds_of,
    together=lambda trial: (trial.case, trial.seed),
    pairs=(("ours", "pieces"), ("ours", "thesis"), ("ours", "entities"), ("ours", "langsplat"), ("ours", "lerf")),
    compared=("recall_3d", "recall_at_rejection", "recall_2d", "precision", "absent_rejected"),
    parameters=WordsParameters,
    places=frozenset({"data"}),
    inputs=inputs,
    quick={"rooms": 2, "steps": 100, "lerf_steps": 30},
    steps=(*STEPS, "segment", "fuse", "splat build", "splat language", "splat label"),
)
