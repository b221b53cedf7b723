"""Tasks by name in generated rooms: in the exact scene, and in scenes reconstructed from images, executed in physics.

Figures are `all/<case>/<measure>` over all tasks and `<task>/<case>/<measure>`. Seconds are of CPU, one process; rooms
of a case are the same for every task.
"""

from __future__ import annotations

import os
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import get_args

import numpy as np
from scenewright.schemas.cad_library import CadLibrary
from scenewright.schemas.errors import BadInput
from scenewright.schemas.ground_truth import GroundTruth
from scenewright.schemas.interactive_scene import InteractiveScene
from scenewright.stages.kit.measurement.bootstrap import pooled_interval
from scenewright.stages.kit.measurement.proportions import wilson_interval
from scenewright.stages.kit.progress import SilentProgress
from scenewright.stages.kit.tasks.pddl import parse_domain, parse_problem
from scenewright.stages.kit.tasks.strips import positive_task
from scenewright.stages.kit.tasks.task_planner import plan_task
from scenewright.stages.plan import TaskName

from benchmarks.experiment import RESAMPLES, SEED_OF_INTERVALS, Bench, Experiment, Results, Trial
from benchmarks.experiments.planning_tamp.rooms import exact_room
from benchmarks.steps import made, opened, unrecorded
from benchmarks.tabulation import Figure

TASKS: tuple[TaskName, ...] = get_args(TaskName)
GROUPS = {task: (task,) for task in TASKS} | {
    "all": TASKS,
    "without stack-and-carry": tuple(task for task in TASKS if task != "stack-and-carry"),
}
EXACT, ORACLE = "exact", "oracle"
LOOKS: dict[str, dict[str, object]] = {
    ORACLE: {},
    "perceived": {"eyes": "camera"},
    "noisy_look": {"eyes": "noisy"},
    "open_loop": {"eyes": "noisy", "relocalize": False},
    "perceived_estimated": {"eyes": "camera"},
}
"""Case in a reconstructed room -> what the robot sees before it acts: the truth, what can be fitted to pictures, the
truth through a robot and a segmentation that err, nothing."""
OF_ESTIMATED = frozenset({"perceived_estimated"})
"""Cases whose room is reconstructed with poses that are estimated from its log."""
ROBOTS: dict[str, dict[str, object]] = {
    EXACT: {},
    "exact_ur5": {"robot": "ur5"},
    "exact_kinova_gen3": {"robot": "kinova_gen3"},
}
"""Case in the exact room -> whose arm stands on the driving base: a Panda's, or another."""
CASES = (*ROBOTS, *LOOKS)
RECIPE = "household"
ROOMS, QUICK_ROOMS = 50, 2
TUNING, REPORTING = (*range(0, ROOMS), *range(1200, 1218)), range(1218, 1218 + ROOMS)
"""Rooms 1000 to 1217 have met earlier versions of `plan`: they do not report."""
FRAMES = 120
LIBRARY_SEED = 1
Link = tuple[str, str, dict[str, str], tuple[str, ...]]
CHAIN: tuple[Link, ...] = (
    ("ingest", "sequence", {"log": "ground_truth/log.mcap"}, ()),
    ("segment", "segments", {"sequence": "sequence"}, ("--backend", "ground-truth", "--corruption", "0.2")),
    ("fuse", "panoptic_map", {"sequence": "sequence", "segments": "segments"}, ()),
    ("graph", "contact_graph", {"panoptic-map": "panoptic_map"}, ()),
    ("cad", "cad_scene", {"contact-graph": "contact_graph", "panoptic-map": "panoptic_map"}, ("library",)),
    ("urdf", "interactive_scene", {"cad-scene": "cad_scene"}, ()),
)
"""Command, artifact, inputs and further options of the way from a log to a scene, as in the pipeline `demo`."""
DENSER = 5
"""Pictures of a recording that poses are estimated from for each one that is mapped: cameras that are tracked give
many; from the mapped ones alone paths came out wrong by up to metres."""
ESTIMATING: tuple[Link, ...] = (
    ("ingest", "dense/sequence", {"log": "dense/ground_truth/log.mcap"}, ()),
    ("poses", "trajectory", {"sequence": "dense/sequence"}, ("--accept", "tracking_lost", "--accept", "contradictory")),
)


@dataclass(frozen=True)
class RoomResult:
    """What came of one task in one room."""

    task: str
    case: str
    seed: int
    success: bool
    """Executed, and all conditions hold at the end."""
    status: str
    reason: str
    """Kind of the failure that ended it, "" on success; `no_room` when the recipe found none, `no_goal` when the scene
    lacks what the task needs."""
    actions: int
    seconds: dict[str, float]
    """CPU seconds by part: `load the scene`, `plan`, `execute`, `task search` (again, by itself)."""


class _CpuProgress(SilentProgress):
    """Times the parts of a step by this process's CPU clock."""

    @contextmanager
    def step(self, description: str) -> Iterator[None]:
        started = time.process_time()
        try:
            yield
        finally:
            self.seconds[description] = self.seconds.get(description, 0.0) + time.process_time() - started


def plan_room(
    scene: InteractiveScene, truth: GroundTruth | None, trial: Trial, folder: Path, **options: object
) -> RoomResult:
    """Plan a task in a scene and execute it, in the true room where that is given; the artifact goes to `folder`."""
    progress = _CpuProgress()
    parameters = {"task": trial.arm, "video_rate": 0.0, "image_width": 64} | options
    inputs = {"scene": scene} | ({} if truth is None else {"ground_truth": truth})
    found = unrecorded("plan", folder, parameters, seed=int(trial.seed), progress=progress, **inputs).info
    success = found.status == "executed"
    reason = "" if success else found.failures[-1].kind if found.failures else found.status
    seconds = {name: value for name, value in progress.seconds.items() if name in ("load the scene", "plan", "execute")}
    if found.goal:
        seconds["task search"] = _search_seconds(folder)
    rounded = {name: round(value, 3) for name, value in seconds.items()}
    return RoomResult(
        trial.arm, trial.case, int(trial.seed), success, found.status, reason, len(found.actions), rounded
    )


def _search_seconds(folder: Path) -> float:
    """Return the CPU seconds of one task search for the PDDL that a plan wrote, reading included."""
    started = time.process_time()
    domain = parse_domain((folder / "domain.pddl").read_text(encoding="utf-8"))
    problem = parse_problem((folder / "problem.pddl").read_text(encoding="utf-8"), domain)
    plan_task(*positive_task(domain, problem))
    return time.process_time() - started


def chain(seed: int, *, estimated: bool) -> tuple[Link, ...]:
    """Return the way from a room to a scene; what follows from `estimated` poses stands in a folder apart."""
    recording = recorded("ground_truth", seed, FRAMES)
    if not estimated:
        return recording, *CHAIN
    before, after = CHAIN[:2], CHAIN[2:]
    apart = {name: f"estimated/{name}" for _, name, _, _ in after}
    links = [
        (command, apart[name], {option: apart.get(source, source) for option, source in inputs.items()}, options)
        for command, name, inputs, options in after
    ]
    command, name, inputs, options = links[0]
    fused = (command, name, inputs | {"trajectory": "trajectory"}, options)
    small = ("--width", "320", "--height", "240")  # all that `poses` looks at
    dense = recorded("dense/ground_truth", seed, DENSER * (FRAMES - 1) + 1, small)
    return recording, *before, dense, *ESTIMATING, fused, *links[1:]


def recorded(name: str, seed: int, frames: int, size: tuple[str, ...] = ()) -> Link:
    """Return how the room of a seed is recorded: whatever the frames, along the same walk in the same time."""
    return "synthesize", name, {}, ("--recipe", RECIPE, "--frames", str(frames), "--seed", str(seed), *size, "library")


def reconstructed_room(
    library: Path, seed: int, folder: Path, *, estimated: bool = False
) -> tuple[InteractiveScene, GroundTruth]:
    """Record the room of a seed and reconstruct it, with given poses or such as are `estimated`, each step as its own
    process. Raises StepFailed."""
    links = chain(seed, estimated=estimated)
    for command, name, inputs, options in links:
        words: list[object] = []
        for option, source in inputs.items():
            words += [f"--{option}", folder / source]
        for option in options:
            words += ["--library", library] if option == "library" else [option]
        made(command, folder / name, *words)
    return opened(InteractiveScene, folder / links[-1][1]), opened(GroundTruth, folder / "ground_truth")


def prepare(bench: Bench, trials: Sequence[Trial]) -> None:
    """Make the library."""
    made("library build", bench.out / "cad_library", "--seed", LIBRARY_SEED)


def measure(bench: Bench, trials: Sequence[Trial]) -> Iterator[tuple[Trial, RoomResult]]:
    """Yield the results of the tasks in the room of one seed; a room that cannot be made is a result too."""
    seed, rooms = int(trials[0].seed), dict[bool, tuple[InteractiveScene, GroundTruth | None]]()
    try:
        for estimated in sorted({trial.case in OF_ESTIMATED for trial in trials}):
            rooms[estimated] = _room(bench.out, seed, exact=trials[0].case in ROBOTS, estimated=estimated)
    except BadInput as error:
        print(f"room {seed}: {error}")
        for trial in trials:
            yield trial, RoomResult(trial.arm, trial.case, seed, False, "infeasible", "no_room", 0, {})
        return
    for trial in trials:
        scene, truth = rooms[trial.case in OF_ESTIMATED]
        yield trial, plan_room(scene, truth, trial, bench.folder(trial) / "plan", **(ROBOTS | LOOKS)[trial.case])


def _room(root: Path, seed: int, *, exact: bool, estimated: bool) -> tuple[InteractiveScene, GroundTruth | None]:
    library, folder = root / "cad_library", root / "rooms" / ("exact" if exact else "reconstructed") / str(seed)
    if exact:
        return exact_room(CadLibrary(library), RECIPE, seed, folder / "room", shut=True), None
    return reconstructed_room(library, seed, folder / "chain", estimated=estimated)


def figures(results: Sequence[RoomResult]) -> dict[str, Figure | None]:
    """Return `<task>/<case>/<measure>`, `all` and `without stack-and-carry` among the tasks: success of the rooms with
    a goal, seconds and actions (medians of those that succeeded), failures by kind; and the success of each case of
    reconstructed rooms over that of the oracle in the same rooms.

    A room has what a task needs when the task has a goal in any case of that room: what a reconstruction lacks is its
    failure.
    """
    found: dict[str, Figure | None] = {}
    able = {(result.task, result.seed) for result in results if result.reason not in ("no_goal", "no_room")}
    posed = [result for result in results if (result.task, result.seed) in able and result.reason != "no_room"]
    for case in CASES:
        for group, tasks in GROUPS.items():
            own = [result for result in posed if result.case == case and result.task in tasks]
            if own:
                found |= {f"{group}/{case}/{name}": figure for name, figure in _of_group(own).items()}
    for case in LOOKS:
        if case != ORACLE:
            found[f"all/{case}/over the oracle"] = _share_of_oracle(posed, case)
    return found


def _of_group(posed: Sequence[RoomResult]) -> dict[str, Figure]:
    good = [result for result in posed if result.success]
    low, high = success_interval(posed)
    made = {
        "success": Figure(100 * len(good) / len(posed), 100 * low, 100 * high, len(posed), "%"),
        "rooms": Figure(len({result.seed for result in posed}), None, None, None, ""),
    }
    if good:
        made["actions"] = Figure(float(np.median([result.actions for result in good])), None, None, len(good), "")
    for part in ("load the scene", "task search", "plan", "execute"):
        values = [result.seconds[part] for result in posed if part in result.seconds]
        if values:
            made[part] = Figure(float(np.median(values)), None, None, len(values), "s")
            made[f"{part}, p95"] = Figure(float(np.percentile(values, 95)), None, None, len(values), "s")
    for reason, count in Counter(result.reason for result in posed if not result.success).items():
        made[f"failed_{reason}"] = Figure(count, None, None, len(posed), "")
    return made


def _by_room(results: Sequence[RoomResult]) -> dict[int, list[bool]]:
    rooms: dict[int, list[bool]] = {}
    for result in results:
        rooms.setdefault(result.seed, []).append(result.success)
    return rooms


def success_interval(posed: Sequence[RoomResult]) -> tuple[float, float]:
    """Return the 95 % interval of the share of successes: Wilson's where each room was tried once, else a bootstrap
    over rooms, as the tasks of one room succeed and fail together."""
    rooms = _by_room(posed)
    if len(rooms) == len(posed):
        return wilson_interval(sum(result.success for result in posed), len(posed))
    parts = np.array([(sum(room), len(room)) for room in rooms.values()], float)
    found = pooled_interval(parts, None, np.random.default_rng(SEED_OF_INTERVALS), resamples=RESAMPLES)
    assert found is not None  # there is a room
    return found.low, found.high


def _share_of_oracle(posed: Sequence[RoomResult], case: str) -> Figure | None:
    """Return the successes of a case over those of the oracle on the tasks that both were tried on, by room."""
    there = {(result.task, result.seed): result for result in posed if result.case == case}
    pairs = [(there[key], r) for r in posed if r.case == ORACLE and (key := (r.task, r.seed)) in there]
    parts = {seed: np.zeros(2) for seed in {told.seed for _, told in pairs}}
    for own, told in pairs:
        parts[told.seed] += (own.success, told.success)
    if not parts:
        return None
    sums, random = np.array(list(parts.values())), np.random.default_rng(SEED_OF_INTERVALS)
    found = pooled_interval(sums, None, random, resamples=RESAMPLES)
    return None if found is None else Figure(found.value, found.low, found.high, len(pairs), "")


def more_figures(results: Results) -> dict[str, Figure | None]:
    """All figures: what counts as a try depends on all cases of a room."""
    return figures(list(results.records.values()))


EXPERIMENT = Experiment(
    name="planning_tamp",
    title="Tasks by name, planned and executed",
    simulated="household rooms, a mobile arm, physics; the log, spoiled true masks",
    knows="before an action, rendered depth pictures (oracle: the truth)",
    does_not_show="Execution on a robot. Whether an action had its effect and whether the goal holds is told by the "
    "truth, with any eyes.",
    arms={task: task for task in TASKS},
    cases=CASES,
    tuning=tuple(map(str, TUNING)),
    reporting=tuple(map(str, REPORTING)),
    together=lambda trial: (trial.case in ROBOTS, trial.seed),
    measure=measure,
    record=RoomResult,
    measures={},
    more_figures=more_figures,
    quick_seeds=QUICK_ROOMS,
    jobs=min(2, os.cpu_count() or 1),
    prepare=prepare,
    steps=("library build", "plan", *(command for command, *_ in chain(0, estimated=True))),
)
