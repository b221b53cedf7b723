"""What a map loses by key frames: all frames of a recording, those that `ingest --every auto` takes, as many evenly.

Rooms, recordings and errors of masks are the board's, with masks of every frame: 391 of a walk of 52 seconds. A seed is
a room. The maps are judged as the board judges them.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from pydantic import Field
from scenewright.schemas.ground_truth import GroundTruth
from scenewright.schemas.panoptic_map import PanopticMap
from scenewright.schemas.places import HOME
from scenewright.schemas.sequence import Sequence as SequenceArtifact
from scenewright.stages.evaluate import label_true_points, load_map, load_truth
from scenewright.stages.kit.stage import Parameters

from benchmarks.board.inputs import Generator, RoomInputs
from benchmarks.board.judge import OPTIONS, of_map
from benchmarks.board.method import Method
from benchmarks.board.reconstruct import processor_seconds
from benchmarks.experiment import Bench, Experiment, Trial, mean
from benchmarks.steps import opened

ROOMS = "rooms"
ALL, KEY, EVENLY = "all", "key", "evenly"
TUNING = ("kitchen-9001", "office-9001", "bedroom-9001")
REPORTING = ("kitchen-9002", "office-9002", "bedroom-9002", "room-9002", "household-9003", "lodging-9003")


class KeyFrameParameters(Parameters):
    """Options of the experiment."""

    board: Path = Field(Path("outputs/board"), description="Folder in which the board's rooms are made and kept")


@dataclass(frozen=True)
class Mapped:
    """What came of the frames of one arm."""

    frames: int
    pq: float
    pq_thesis_form: float
    ghosts: float
    seconds: float
    """Processor time of `ingest`, `segment` and `fuse` [s]; masks are given."""


def measure(bench: Bench, trials: Sequence[Trial]) -> Iterator[tuple[Trial, Mapped]]:
    """Yield what became of each choice of frames of a room."""
    generator = Generator(bench.parameters.board)
    generator.prepare()
    inputs = generator.every_frame(trials[0].seed)
    for trial in trials:
        folder = bench.folder(trial)
        every: int | str = "auto" if trial.arm == KEY else 1
        if trial.arm == EVENLY:
            every = even_step(inputs, folder / "key_frames")
        yield trial, map_frames(inputs, folder, every)


def even_step(inputs: RoomInputs, folder: Path) -> int:
    """Return of how many frames one is taken for as many as there are key frames. Raises MethodFailed."""
    Method(HOME).run("ingest", folder, "--log", inputs.log, "--every", "auto")
    info = opened(SequenceArtifact, folder).info
    return max(1, round(info.frames_in_log / info.frame_count))


def map_frames(inputs: RoomInputs, folder: Path, every: int | str) -> Mapped:
    """Map some frames of a recording and judge the map. Raises MethodFailed."""
    method = Method(HOME)
    sequence, segments, fused = folder / "sequence", folder / "segments", folder / "panoptic_map"
    method.run("ingest", sequence, "--log", inputs.log, "--every", every)
    method.run("segment", segments, "--sequence", sequence, "--backend", "masks", "--masks", inputs.masks)
    method.run("fuse", fused, "--sequence", sequence, "--segments", segments)
    world_from_log = np.array(opened(SequenceArtifact, sequence).info.gravity.world_from_log)
    room = load_truth(opened(GroundTruth, inputs.truth), world_from_log, OPTIONS.minimum_visible_points)
    predicted = load_map(opened(PanopticMap, fused))
    figures = of_map(room, predicted, label_true_points(room, predicted, OPTIONS.label_distance))
    return Mapped(
        frames=opened(SequenceArtifact, sequence).info.frame_count,
        pq=figures["pq"],
        pq_thesis_form=figures["pq_thesis_form"],
        ghosts=figures["ghosts"],
        seconds=sum(processor_seconds(made) for made in (sequence, segments, fused)),
    )


EXPERIMENT = Experiment(
    name="key_frames",
    title="Maps of key frames",
    simulated="Rooms, walks, images and noisy depth; masks are the true ones with lasting errors of a detector.",
    knows="Poses, and masks of every frame.",
    does_not_show=(
        "A recording at a camera's full rate: the walks have a quarter of it, so key frames are a larger share. "
        "Blur: images are sharp. Networks, whose time falls with the number of frames."
    ),
    arms={ALL: "all frames", KEY: "key frames", EVENLY: "as many frames, evenly"},
    cases=(ROOMS,),
    tuning=TUNING,
    reporting=REPORTING,
    measure=measure,
    record=Mapped,
    measures={
        "frames": mean("frames", interval=False),
        "pq": mean("pq"),
        "pq_thesis_form": mean("pq_thesis_form"),
        "ghosts": mean("ghosts"),
        "seconds": mean("seconds", "s", interval=False),
    },
    quick_seeds=1,
    parameters=KeyFrameParameters,
    places=frozenset({"board"}),
    steps=("ingest", "segment", "fuse"),
    pairs=((KEY, ALL), (KEY, EVENLY), (EVENLY, ALL)),
    compared=("pq", "pq_thesis_form"),
)
