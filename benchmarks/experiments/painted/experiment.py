"""Maps of real rooms against a surface that somebody painted, beside what annotated boxes say of the same maps.

Cases are the logs in whose frames the annotated things were outlined (data/annotations/real/painted). Arms are masks:
those of a small detector, and `painted`, the painted surface itself brought into every frame, which is what the rest of
the chain makes of masks without a fault of a network: a ceiling. Those masks and the truth are the same outlines. Not
so in `others`: masks of every other painted frame, judged by the outlines of those between.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from pydantic import Field
from scenewright.schemas.panoptic_map import PanopticMap
from scenewright.schemas.sequence import Sequence as SequenceArtifact
from scenewright.stages.evaluate import load_map, load_truth
from scenewright.stages.kit.stage import Parameters

from benchmarks.board.real.annotated import annotated_truth
from benchmarks.board.real.chain import masks_of
from benchmarks.board.real.logs import ANNOTATIONS, LOGS, OUTLINES
from benchmarks.experiment import Bench, Experiment, Measure, Trial
from benchmarks.experiments.painted.judging import Judged, judge_map
from benchmarks.experiments.painted.masks import write_masks
from benchmarks.graph_scores import OPTIONS
from benchmarks.steps import made, opened

PAINTED = tuple(name for name in LOGS if (OUTLINES / f"{name}.json").is_file())
MASKS = {"painted": "painted", "others": "one"}
"""Arm -> the truth whose surface its masks show."""
SEED = "log"
"""A log is one."""


class PaintedParameters(Parameters):
    """Options of the experiment."""

    data: Path = Field(Path("../shared/data"), description="Folder with the real logs and networks of others")


@dataclass(frozen=True)
class Both:
    """One map, by either truth."""

    boxes: Judged
    painted: Judged


def seeds_of(bench: Bench, case: str) -> Sequence[str]:
    """The log, where it is at hand."""
    return [SEED] if LOGS[case].within(bench.parameters.data).path.exists() else []


def measure(bench: Bench, trials: Sequence[Trial]) -> Iterator[tuple[Trial, Both]]:
    """Read a log once, fuse it with the masks of each arm, and judge each map by both truths."""
    case, data = trials[0].case, bench.parameters.data
    folder = bench.out / "logs" / case
    sequence = opened(SequenceArtifact, made("ingest", folder / "sequence", *LOGS[case].within(data).words))
    halves = halved(OUTLINES / f"{case}.json", folder)
    files = {"boxes": None, "painted": OUTLINES / f"{case}.json", "one": halves[0], "other": halves[1]}
    for way in files:
        (folder / way).mkdir(exist_ok=True)
    told = {way: annotated_truth(case, sequence, folder / way, file) for way, file in files.items()}
    for trial in trials:
        masks: tuple[object, ...] = masks_of(data)
        if trial.arm in MASKS:
            write_masks(told[MASKS[trial.arm]], sequence, folder / f"{trial.arm}_masks")
            masks = ("--backend", "masks", "--masks", folder / f"{trial.arm}_masks")
        read = ("--sequence", sequence.root)
        segments = made("segment", folder / f"{trial.arm}_segments", *read, *masks)
        path = made("fuse", folder / f"{trial.arm}_map", *read, "--segments", segments)
        predicted = load_map(opened(PanopticMap, path))
        judges = {"boxes": told["boxes"], "painted": told["other" if trial.arm == "others" else "painted"]}
        rooms = {way: load_truth(truth, np.eye(4), OPTIONS.minimum_visible_points) for way, truth in judges.items()}
        yield trial, Both(**{way: judge_map(room, predicted) for way, room in rooms.items()})


def halved(outlines: Path, folder: Path) -> tuple[Path, Path]:
    """Write every other frame of outlines, and those between, below `folder`; return both files."""
    document = json.loads(outlines.read_text(encoding="utf-8"))
    paths = folder / "one.json", folder / "other.json"
    for start, path in enumerate(paths):
        half = document | {"frames": document["frames"][start::2]}
        path.write_text(json.dumps(half), encoding="utf-8")
    return paths


def by(way: str, of: Callable[[Judged], float]) -> Measure:
    """Return the sum over logs of what one of the truths says; of one log that is its figure."""
    return Measure(lambda records: float(sum(of(getattr(record, way)) for record in records)), interval=False)


COUNTS: dict[str, Callable[[Judged], float]] = {
    "large": lambda judged: judged.large,
    "found": lambda judged: judged.found,
    "named": lambda judged: judged.named,
    "names": lambda judged: judged.names,
    "false_names": lambda judged: judged.false_names,
    "false_things": lambda judged: judged.false,
    "quality": lambda judged: judged.quality,
}

EXPERIMENT = Experiment(
    name="painted",
    title="Real rooms by a painted surface, beside boxes",
    simulated="Nothing: two recorded logs, judged by what one person painted in some of their frames.",
    knows="The detector, the log; the painted masks, all that is judged.",
    does_not_show=(
        "A room nobody looked at: rules and thresholds were chosen on both logs. One person painted part of "
        "the frames, to some five pixels; what is not painted counts for nothing. Figures of painted masks "
        "are a ceiling, also where masks and truth are of different frames."
    ),
    arms={
        "detector": "a small detector's boxes",
        "painted": "the painted surface",
        "others": "half of the painted frames, by the other half",
    },
    cases=PAINTED,
    seeds_of=seeds_of,
    together=lambda trial: trial.case,
    measure=measure,
    record=Both,
    measures={f"{way}_{name}": by(way, of) for way in ("boxes", "painted") for name, of in COUNTS.items()},
    parameters=PaintedParameters,
    places=frozenset({"data"}),
    inputs=lambda bench, trial: [
        ANNOTATIONS / f"{trial.case}.json",
        OUTLINES / f"{trial.case}.json",
        LOGS[trial.case].within(bench.parameters.data).path,
    ],
    steps=("ingest", "segment", "fuse", "truth supports"),
)
