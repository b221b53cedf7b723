"""Tasks by name in generated rooms: in the exact scene, and in scenes reconstructed from images, executed in physics.

`run` gives flat figures: `ours/<case>/<measure>` over all tasks and `<task>/<case>/<measure>`; `table` prints them.
One of them is `task_result`. Seconds are of CPU, one process; rooms of a case are the same for every task.
"""

from __future__ import annotations

import json
import multiprocessing
import shutil
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import get_args

import numpy as np

from benchmarks.planning.tamp_rooms import exact_room
from schemas.cad_library import CadLibrary
from schemas.errors import BadInput
from schemas.ground_truth import GroundTruth
from schemas.interactive_scene import InteractiveScene
from stages.kit.measurement.proportions import wilson_interval
from stages.kit.progress import SilentProgress
from stages.kit.stage import Context
from stages.kit.tasks.pddl import parse_domain, parse_problem
from stages.kit.tasks.strips import positive_task
from stages.kit.tasks.task_planner import plan_task
from stages.plan.parameters import PlanParameters
from stages.plan.stage import run as run_plan
from stages.plan.tasks import TaskName

TASKS: tuple[TaskName, ...] = get_args(TaskName)
EXACT, RECONSTRUCTED = "tamp_exact", "tamp_reconstructed"
CASES = (EXACT, RECONSTRUCTED)
RECIPE = "household"
TUNING, REPORTING = range(0, 500), range(1050, 2000)
"""Counts of successes in rooms 1000 to 1018 were seen before the last changes to `plan`: they do not report."""
FRAMES = 120
CHAIN: tuple[tuple[str, str, dict[str, str], tuple[str, ...]], ...] = (
    ("ingest", "sequence", {"log": "ground_truth/log.mcap"}, ()),
    ("segment", "segments", {"sequence": "sequence"}, ("--backend", "ground-truth", "--corruption", "0.2")),
    ("fuse", "panoptic_map", {"sequence": "sequence", "segments": "segments"}, ()),
    ("graph", "contact_graph", {"panoptic-map": "panoptic_map"}, ()),
    ("cad", "cad_scene", {"contact-graph": "contact_graph", "panoptic-map": "panoptic_map"}, ("library",)),
    ("urdf", "interactive_scene", {"cad-scene": "cad_scene"}, ()),
)
"""Command, artifact, inputs and further options of the way from a log to a scene, as in the pipeline `demo`."""


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
    scene: InteractiveScene, truth: GroundTruth | None, task: TaskName, case: str, seed: int, folder: Path,
    **options: object,
) -> RoomResult:  # fmt: skip
    """Plan a task in a scene and execute it, in the true room where that is given; the artifact goes to `folder`."""
    folder.mkdir(parents=True)
    progress = _CpuProgress()
    parameters = PlanParameters.model_validate({"task": task, "video_rate": 0.0, "image_width": 64} | options)
    plan = run_plan(
        scene, truth, parameters=parameters, context=Context(output=folder, seed=seed, device="cpu", progress=progress)
    )
    found = plan.info
    success = found.status == "executed"
    reason = "" if success else found.failures[-1].kind if found.failures else found.status
    seconds = {name: value for name, value in progress.seconds.items() if name in ("load the scene", "plan", "execute")}
    if found.goal:
        seconds["task search"] = _search_seconds(folder)
    return RoomResult(
        task, case, seed, success, found.status, reason, len(found.actions),
        {name: round(value, 3) for name, value in seconds.items()},
    )  # fmt: skip


def _search_seconds(folder: Path) -> float:
    """Return the CPU seconds of one task search for the PDDL that a plan wrote, reading included."""
    started = time.process_time()
    domain = parse_domain((folder / "domain.pddl").read_text(encoding="utf-8"))
    problem = parse_problem((folder / "problem.pddl").read_text(encoding="utf-8"), domain)
    plan_task(*positive_task(domain, problem))
    return time.process_time() - started


def reconstructed_room(library: Path, seed: int, folder: Path) -> tuple[InteractiveScene, GroundTruth]:
    """Record the room of a seed and reconstruct it, each step as its own process; what is there already stays.

    Raises BadInput with the last line of what a step said when it fails.
    """
    made = InteractiveScene(folder / "interactive_scene"), GroundTruth(folder / "ground_truth")
    if (folder / "interactive_scene" / "scene.json").is_file():
        return made
    wishes = ("--recipe", RECIPE, "--frames", str(FRAMES), "--seed", str(seed), "library")
    for command, name, inputs, options in (("synthesize", "ground_truth", {}, wishes), *CHAIN):
        words = [sys.executable, "-m", "cli", command, "--out", str(folder / name)]
        for option, source in inputs.items():
            words += [f"--{option}", str(folder / source)]
        for option in options:
            words += ["--library", str(library)] if option == "library" else [option]
        done = subprocess.run(words, capture_output=True, text=True, check=False)
        if done.returncode not in (0, 4):
            said = done.stderr.strip().splitlines()[-1:] or ["nothing"]
            raise BadInput(f"{command} of room {seed}: {said[0]}")
    return made


def task_result(case: str, seed: int, task: TaskName, library: Path, folder: Path) -> RoomResult:
    """Return the result of a task in the room of one seed; a second call reads `<task>.json` of the first."""
    done = folder / f"{task}.json"
    if done.is_file():
        return RoomResult(**json.loads(done.read_text(encoding="utf-8")))
    try:
        scene, truth = _room(case, seed, library, folder)
    except BadInput as error:
        print(f"room {seed}: {error}", file=sys.stderr)
        return RoomResult(task, case, seed, False, "infeasible", "no_room", 0, {})
    with tempfile.TemporaryDirectory(dir=folder) as scratch:
        plan = Path(scratch) / "plan"
        result = plan_room(scene, truth, task, case, seed, plan)
        shutil.copy(plan / "plan.json", folder / f"{task}.plan.json")
    print(f"{case} {seed} {task}: {result.status} {result.reason}", file=sys.stderr, flush=True)
    done.write_text(json.dumps(asdict(result), indent=1) + "\n", encoding="utf-8")
    return result


def _room(case: str, seed: int, library: Path, folder: Path) -> tuple[InteractiveScene, GroundTruth | None]:
    if case == RECONSTRUCTED:
        return reconstructed_room(library, seed, folder / "chain")
    if not (folder / "room" / "scene.json").is_file():
        exact_room(CadLibrary(library), RECIPE, seed, folder / "room", shut=True)
    return InteractiveScene(folder / "room"), None


def run(
    library: Path, folder: Path, *, seeds: Sequence[int], cases: Sequence[str] = CASES,
    tasks: Sequence[TaskName] = TASKS, jobs: int = 1,
) -> dict[str, float]:  # fmt: skip
    """Return the figures over the rooms of some seeds, `jobs` of them at a time; rooms and results go to `folder` and
    are used again."""
    units = [(case, seed, task) for case in cases for seed in seeds for task in tasks]
    with ProcessPoolExecutor(jobs, mp_context=multiprocessing.get_context("spawn")) as pool:
        found = [
            pool.submit(task_result, case, seed, task, library, folder / case / str(seed)) for case, seed, task in units
        ]
        return figures([unit.result() for unit in found])


def figures(results: Sequence[RoomResult]) -> dict[str, float]:
    """Return `<task>/<case>/<measure>`: rooms, goals (rooms that have what the task needs), success (share of the rooms
    with a goal), seconds and actions (medians of those that succeeded), failures by kind.

    A room has what a task needs when the task has a goal in any case of that room: what a reconstruction lacks is its
    failure.
    """
    metrics: dict[str, float] = {}
    arms: dict[str, list[RoomResult]] = {}
    able = {(result.task, result.seed) for result in results if result.reason not in ("no_goal", "no_room")}
    for result in results:
        if result.reason != "no_room":
            arms.setdefault(f"ours/{result.case}", []).append(result)
            arms.setdefault(f"{result.task}/{result.case}", []).append(result)
    for key, own in sorted(arms.items()):
        posed = [result for result in own if (result.task, result.seed) in able]
        good = [result for result in posed if result.success]
        metrics |= {f"{key}/rooms": len(own), f"{key}/goals": len(posed), f"{key}/successes": len(good)}
        if posed:
            metrics[f"{key}/success"] = round(len(good) / len(posed), 4)
            low, high = wilson_interval(len(good), len(posed))
            metrics |= {f"{key}/success_low": round(low, 4), f"{key}/success_high": round(high, 4)}
        if good:
            metrics[f"{key}/actions"] = float(np.median([result.actions for result in good]))
        for part in ("load the scene", "task search", "plan", "execute"):
            values = [result.seconds[part] for result in posed if part in result.seconds]
            if values:
                metrics[f"{key}/seconds_{part.replace(' ', '_')}"] = round(float(np.median(values)), 3)
                metrics[f"{key}/seconds_{part.replace(' ', '_')}_p95"] = round(float(np.percentile(values, 95)), 3)
        for reason, count in Counter(result.reason for result in posed if not result.success).items():
            metrics[f"{key}/failed_{reason}"] = count
    return metrics


def table(metrics: dict[str, float]) -> str:
    """Return the figures as a Markdown table, a row per task and case."""
    lines = [
        "| task | case | rooms | with a goal | success | actions | task search [s] | planning [s] | execution [s] "
        "| failed by |",
        "|---|---|---|---|---|---|---|---|---|---|",
    ]
    for key in sorted({"/".join(name.split("/")[:2]) for name in metrics}):
        task, case = key.split("/")

        def cell(measure: str, key: str = key) -> str:
            value = metrics.get(f"{key}/{measure}")
            return "" if value is None else f"{value:g}"

        failed = f"{key}/failed_"
        reasons = {name.removeprefix(failed): count for name, count in metrics.items() if name.startswith(failed)}
        words = ", ".join(f"{name} {count:g}" for name, count in sorted(reasons.items(), key=lambda entry: -entry[1]))
        success = metrics.get(f"{key}/success")
        share = ""
        if success is not None:
            low, high = (100 * metrics[f"{key}/success_{end}"] for end in ("low", "high"))
            share = f"{100 * success:.0f} % ({low:.0f} to {high:.0f})"
        lines.append(
            f"| {task} | {case} | {cell('rooms')} | {cell('goals')} | {share} | {cell('actions')} | "
            f"{cell('seconds_task_search')} | {cell('seconds_plan')} | {cell('seconds_execute')} | {words} |"
        )
    return "\n".join([*lines, ""])
