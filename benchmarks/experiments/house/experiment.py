"""A house of others: whether reconstruction is sound where the masks are, and what it is with masks of our own.

Rooms are furnished with models that others made, walked through at head height, rendered by another renderer than ours
with another camera's noise. Their true masks are brought as a folder of pictures (`masks`), or our own network finds
them (`network`). Then the chain runs as it is.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import Field
from scenewright.schemas.cad_library import CadLibrary
from scenewright.stages.kit.stage import Parameters

from benchmarks.experiment import Bench, Experiment, Measure, Results, Trial, mean
from benchmarks.experiments.house.furnishing import RECIPES, furnish
from benchmarks.experiments.house.models import FOLDERS, MODELS, absent, import_all, imported, mesh_of, own_library
from benchmarks.experiments.house.placing import Stand
from benchmarks.experiments.house.recording import record
from benchmarks.experiments.house.scoring import Judged, judge
from benchmarks.experiments.surface.scenes import camera_of
from benchmarks.steps import made, opened
from benchmarks.tabulation import Figure, markdown

MASKS, NETWORK = "masks", "network"
OWN = "own"
"""Folder of the library that has the models of the house too."""
TUNING, SEEDS = ("0",), ("7600",)
"""The second was measured before: it is not fresh."""
LIBRARY_SEED = 1
STEPS = ("library build", "library add", "ingest", "segment", "fuse", "graph", "cad", "urdf")


class HouseParameters(Parameters):
    """Options of the experiment."""

    data: Path = Field(Path("../shared/data"), description="Folder with the models of others")
    frames: int = Field(100, ge=8, description="Of a walk through a room")
    width: int = Field(640, ge=160, le=1920, description="Of the images [pixels]")


def seeds_of(bench: Bench, case: str) -> Sequence[str]:
    """Seeds of rooms; none where models are missing."""
    if absent(bench.parameters.data):
        return ()
    return TUNING if bench.tuning else SEEDS


def prepare(bench: Bench, trials: Sequence[Trial]) -> None:
    """Import the models and make the library that all rooms share."""
    import_all(bench.parameters.data, bench.out / "models")
    library = made("library build", bench.out / "cad_library", "--seed", LIBRARY_SEED)
    own_library(bench.parameters.data, bench.out / OWN, library)


def inputs(bench: Bench, trial: Trial) -> list[Path]:
    """The models."""
    return [bench.parameters.data / place for place, _ in FOLDERS.values()]


def measure(bench: Bench, trials: Sequence[Trial]) -> Iterator[tuple[Trial, Judged]]:
    """Furnish a room, record it, run the chain, judge what came out."""
    libraries = imported(bench.out / "models")
    own = opened(CadLibrary, bench.out / OWN / "library")
    meshes = {name: mesh_of(libraries, model) for name, model in MODELS.items()}
    for trial in trials:
        random = np.random.default_rng([int(trial.seed), sorted(RECIPES).index(trial.case)])
        house = furnish(RECIPES[trial.case], meshes, random)
        run = bench.out / "rooms" / f"{trial.case}-{trial.seed}"
        camera = camera_of(bench.parameters.width)
        recording = record(house, run, camera, bench.parameters.frames, random)
        made("ingest", run / "sequence", "--log", recording.log)
        brought = ("--backend", "masks", "--masks", recording.masks) if trial.arm == MASKS else ("--backend", NETWORK)
        out = run / trial.arm
        made("segment", out / "segments", "--sequence", run / "sequence", *brought)
        both = ("--sequence", run / "sequence", "--segments", out / "segments")
        made("fuse", out / "panoptic_map", *both)
        made("graph", out / "contact_graph", "--panoptic-map", out / "panoptic_map")
        parts = ("--panoptic-map", out / "panoptic_map", "--contact-graph", out / "contact_graph")
        made("cad", out / "cad_scene", *parts, "--library", bench.out / "cad_library")
        made("urdf", out / "interactive_scene", "--cad-scene", out / "cad_scene")
        if trial.arm == MASKS:
            made("cad", out / "own_scene", *parts, "--library", own.root)
        yield trial, judge(house, recording, run / "sequence", out, own)


def pooled(figure: Callable[[Sequence[Judged]], float], unit: str = "") -> Measure:
    """A figure over all rooms of a case."""
    return Measure(figure, unit)


def _own(right: Callable[[Stand], bool]) -> Measure:
    """Share of the things whose model the library has for which `right` holds [%]; None where no such scene is."""

    def share(rooms: Sequence[Judged]) -> float | None:
        held = [right(stand) for room in rooms for stand in room.own]
        return 100 * float(np.mean(held)) if held else None

    return Measure(share, "%")


def _total(records: Sequence[Judged], name: str) -> int:
    return sum(getattr(record, name) for record in records)


def notes(results: Results) -> str:
    """What was missed in which room."""
    rows = []
    for trial, room in results.records.items():
        own = [f"{stand.thing}: {stand.decision} {stand.chosen}" for stand in room.own if not stand.right]
        wrong = (
            *room.missed,
            *room.wrong_supports,
            *room.holes,
            *room.restless,
            *room.false_joints,
            *room.nested,
            *own,
        )
        rows.append([trial.arm, trial.case, trial.seed, f"{100 * room.pq:.1f}", str(room.movable), "; ".join(wrong)])
    return markdown("Rooms", ("masks", "room", "seed", "PQ", "movable", "wrong"), rows)


def more_figures(results: Results) -> dict[str, Figure]:
    """All rooms together."""
    figures: dict[str, Figure] = {}
    for arm in EXPERIMENT.arms:
        rooms: list[Any] = [room for trial, room in results.records.items() if trial.arm == arm]
        if rooms:
            for name, figure in EXPERIMENT.measures.items():
                if (value := figure.of(rooms)) is not None:
                    figures[f"{arm}/all/{name}"] = Figure(float(value), None, None, len(rooms), figure.unit)
    return figures


EXPERIMENT = Experiment(
    name="house",
    title="A house of others",
    simulated="Rooms furnished at random with models that others made; a rasteriser's pictures, flat colours; depth "
    "with the noise of Barron and Malik's camera; exact poses.",
    knows="Colour, depth, camera and poses; the true masks with their classes, or none; a generated CAD library.",
    does_not_show="Errors of poses and of calibration; textures, mirrors and glass; rooms that people have lived in.",
    arms={MASKS: "true masks", NETWORK: "our own network"},
    cases=tuple(RECIPES),
    tuning=TUNING,
    reporting=SEEDS,
    seeds_of=seeds_of,
    prepare=prepare,
    inputs=inputs,
    measure=measure,
    record=Judged,
    measures={
        "pq": Measure(lambda rooms: 100 * float(np.mean([room.pq for room in rooms])), "%"),
        "support_f1": pooled(
            lambda rooms: (
                2
                * _total(rooms, "support_hits")
                / max(_total(rooms, "supports_true") + _total(rooms, "supports_found"), 1)
            )
        ),
        "tops_whole": pooled(lambda rooms: 100 * _total(rooms, "tops_whole") / max(_total(rooms, "tops"), 1), "%"),
        "least_top": Measure(lambda rooms: 100 * min(room.least_top for room in rooms), "%", interval=False),
        "level_mapped": Measure(lambda rooms: 100 * float(np.mean([room.level_mapped for room in rooms])), "%"),
        "things": mean("things", interval=False),
        "matched": mean("matched", interval=False),
        "movable": mean("movable", interval=False),
        "least_movable": Measure(lambda rooms: float(min(room.movable for room in rooms)), interval=False),
        "at_rest": pooled(lambda rooms: 100 * _total(rooms, "at_rest") / max(_total(rooms, "movable"), 1), "%"),
        "settled": Measure(lambda rooms: 100 * float(np.mean([room.settled for room in rooms])), "%", interval=False),
        "own_right": _own(lambda stand: stand.right),
        "own_chosen": _own(lambda stand: stand.own),
        "own_found": _own(lambda stand: stand.decision != "missed"),
        "joints": Measure(lambda rooms: float(_total(rooms, "joints")), interval=False),
        "false_joints": Measure(lambda rooms: float(sum(len(room.false_joints) for room in rooms)), interval=False),
        "nested": Measure(lambda rooms: float(sum(len(room.nested) for room in rooms)), interval=False),
        "deepest": Measure(lambda rooms: max(room.penetration_mm for room in rooms), "mm", interval=False),
    },
    parameters=HouseParameters,
    places=frozenset({"data"}),
    quick={"frames": 60},
    steps=STEPS,
    more_figures=more_figures,
    notes=notes,
)
