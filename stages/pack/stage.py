"""The step `pack`: one packing problem, one proposer, the loop of LLM3, pictures of what happened."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from scenewright.schemas.packing import Packing, PackingAttempt, PackingFile, PackingStep
from scenewright.stages.kit.language.chat import Chat
from scenewright.stages.kit.language.failures import LanguageFailed
from scenewright.stages.kit.language.opening import open_chat
from scenewright.stages.kit.stage import Context
from scenewright.stages.pack.environment import PackingWorld
from scenewright.stages.pack.hard_suites import hard_instance
from scenewright.stages.pack.instances import Instance, published_instance
from scenewright.stages.pack.language_prompt import Variant
from scenewright.stages.pack.language_scripted import scripted_backend
from scenewright.stages.pack.loop import Budget, GaveUp, PackingRun, run_loop
from scenewright.stages.pack.motion import MotionPlanner
from scenewright.stages.pack.parameters import PackParameters
from scenewright.stages.pack.pictures import draw_attempts, draw_layout, draw_scene
from scenewright.stages.pack.problem_file import read_problem, to_file
from scenewright.stages.pack.proposers import PROPOSERS, Setting
from scenewright.stages.pack.records import Action, Attempt, Observation, Proposer

INSTANCES: dict[str, Callable[[str, PackParameters], Instance]] = {
    "published": lambda cell, parameters: published_instance(cell, parameters.instance),
    "hard": lambda cell, parameters: hard_instance(cell, parameters.instance, parameters.limits),
}
"""Suite -> instance of one of its cells."""


def run(problem: Path | None, transcript: Path | None, *, parameters: PackParameters, context: Context) -> Packing:
    """Pack the boxes of the user's problem, or of an instance of a suite."""
    planner = MotionPlanner(parameters.limits, context.seed, parameters.robot)
    try:
        instance = replace(_instance(problem, parameters, planner), hand=planner.hand)
        proposer = _proposer(parameters, transcript, context)
        with PackingWorld(instance, planner=planner) as world:
            with context.progress.step("propose and check"):
                result = run_loop(world, _Guarded(proposer), Budget(parameters.iterations, parameters.motion_calls))
            _write(context.output, _packing_file(instance, proposer, result, planner), instance, result, planner)
            with context.progress.step("pictures"):
                draw_layout(context.output / "layout.png", world, result, parameters.image_width)
                draw_attempts(context.output / "attempts.png", result.attempts, parameters.image_width)
                draw_scene(context.output / "scene.png", world, result, parameters.image_width)
    finally:
        planner.close()
    summary = {
        "problem": instance.name,
        "proposer": proposer.name,
        "success": result.success,
        "proposer_calls": result.proposer_calls,
        "motion_planner_calls": result.motion_calls,
    }
    return Packing(root=context.output, outcome="ok" if result.success else "not_packed", summary=summary)


class _Guarded:
    """A proposer whose language model may stop answering: the loop then ends with what there is, so that the replies
    that were paid for are kept. Before the first plan there is nothing to keep: the error ends the step."""

    def __init__(self, proposer: Proposer) -> None:
        self.name, self.calls, self._proposer = proposer.name, proposer.calls, proposer

    def propose(self, observation: Observation, trace: Sequence[Attempt]) -> tuple[Action, ...]:
        """Return the proposer's plan; raises GaveUp, and LanguageFailed before the first plan."""
        try:
            return self._proposer.propose(observation, trace)
        except LanguageFailed as error:
            if not trace:
                raise
            raise GaveUp(error.failure) from None
        finally:
            self.calls = self._proposer.calls


def _instance(problem: Path | None, parameters: PackParameters, planner: MotionPlanner) -> Instance:
    if problem is not None:
        return read_problem(problem, planner.arm)
    suite, cell = parameters.suite.split("/")
    return INSTANCES[suite](cell, parameters)


def _proposer(parameters: PackParameters, transcript: Path | None, context: Context) -> Proposer:
    def chat(variant: Variant) -> Chat:
        return open_chat(
            parameters,
            scripted=scripted_backend(variant, context.seed),
            transcript=transcript,
            record=context.output / "transcript.jsonl",
        )

    setting = Setting(context.seed, parameters.reasons, parameters.trace_length, chat)
    return PROPOSERS[parameters.proposer](setting)


def _attempt(attempt: Attempt) -> PackingAttempt:
    steps = []
    for number, action in enumerate(attempt.actions):
        tried = number < len(attempt.feedback)
        steps.append(
            PackingStep(
                name=action.name,
                box=action.box,
                x=action.x,
                y=action.y,
                yaw=action.yaw,
                tried=tried,
                failure=attempt.feedback[number].failure if tried else None,
            )
        )
    return PackingAttempt(steps=tuple(steps), task=attempt.task)


def _packing_file(instance: Instance, proposer: Proposer, result: PackingRun, planner: MotionPlanner) -> PackingFile:
    return PackingFile(
        name=instance.name,
        proposer=proposer.name,
        robot=planner.arm.description.name,
        success=result.success,
        proposer_calls=result.proposer_calls,
        motion_planner_calls=result.motion_calls,
        attempts=tuple(_attempt(attempt) for attempt in result.attempts),
        stopped=result.stopped,
    )


def _write(output: Path, file: PackingFile, instance: Instance, result: PackingRun, planner: MotionPlanner) -> None:
    file.write(output / "packing.json")
    to_file(instance).write(output / "instance.json")
    output.joinpath("plan.txt").write_text(plan_text(file), encoding="utf-8")
    paths = [motion.path for motion in result.motions] if result.success else []
    joints = np.concatenate(paths) if paths else np.zeros((0, len(planner.arm.home)))
    action = np.repeat(np.arange(len(paths)), [len(path) for path in paths])
    np.savez(output / "trajectory.npz", joints=joints, action=action.astype(np.int64))


def plan_text(file: PackingFile) -> str:
    """Return the attempts as people read them: each action with what motion planning said."""
    lines = [f"{file.name}, proposed by {file.proposer}"]
    for number, attempt in enumerate(file.attempts, start=1):
        lines.append(f"\nattempt {number}")
        for step in attempt.steps:
            where = "" if step.x is None else f" at ({step.x:.3f}, {step.y:.3f}), yaw {step.yaw:.2f}"
            outcome = "not tried" if not step.tried else "feasible" if step.failure is None else step.failure.message
            lines.append(f"  {step.name} {step.box}{where}: {outcome}")
        if attempt.task is not None:
            lines.append(f"  {attempt.task.message}")
    end = "packed" if file.success else "not packed"
    if file.stopped is not None:
        end += f": {file.stopped.message}"
    calls = f"{file.proposer_calls} proposer calls, {file.motion_planner_calls} motion-planner calls"
    return "\n".join([*lines, f"\n{end}; {calls}"]) + "\n"
