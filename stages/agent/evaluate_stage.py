"""The step `agent evaluate`: arms over tasks and seeds, in one table."""

from __future__ import annotations

from collections.abc import Sequence

from scenewright.schemas.agent_episode import AgentEvaluation, AgentEvaluationFile, EvaluatedArm
from scenewright.schemas.errors import UsageError
from scenewright.stages.agent.arms.registry import ARMS
from scenewright.stages.agent.judging import Score, score
from scenewright.stages.agent.parameters import EvaluateParameters
from scenewright.stages.agent.tasks import TASKS, make_apartment
from scenewright.stages.agent.trials import Setting, run_trial
from scenewright.stages.agent.world.failures import Rates
from scenewright.stages.agent.world.floor import Floor
from scenewright.stages.kit.stage import Context


def run(*, parameters: EvaluateParameters, context: Context) -> AgentEvaluation:
    """Compare arms, each on the same apartments with the same luck."""
    for names, available, sort in ((parameters.tasks, TASKS, "task"), (parameters.arms, ARMS, "arm")):
        for name in names:
            if name not in available:
                raise UsageError(f"there is no {sort} {name!r}", hint=f"choose one of {', '.join(available)}")
    rows = []
    for task in context.progress.track(parameters.tasks, total=len(parameters.tasks), description="tasks"):
        by_arm = _scores(task, parameters)
        rows += [_row(task, arm, scores) for arm, scores in by_arm.items()]
    file = AgentEvaluationFile(
        first_seed=parameters.first_seed,
        failures=parameters.failures,
        perception=parameters.perception,
        rows=tuple(rows),
    )
    file.write(context.output / "results.json")
    context.output.joinpath("table.md").write_text(as_markdown(file), encoding="utf-8")
    summary = {"tasks": len(parameters.tasks), "arms": len(parameters.arms), "trials": parameters.trials}
    return AgentEvaluation(root=context.output, summary=summary)


def _scores(name: str, parameters: EvaluateParameters) -> dict[str, list[Score]]:
    task, rates = TASKS[name], Rates().scaled(parameters.failures, parameters.perception)
    scores_of_arm: dict[str, list[Score]] = {arm: [] for arm in parameters.arms}
    for seed in range(parameters.first_seed, parameters.first_seed + parameters.trials):
        apartment = make_apartment(task, seed)
        setting = Setting(apartment, task.words, task.goals, rates, seed, floor=Floor(apartment))
        for arm in parameters.arms:
            session, world = run_trial(setting, arm)
            scores_of_arm[arm].append(score(task.goals, task.impossible, session, world))
    return scores_of_arm


def _row(task: str, arm: str, scores: Sequence[Score]) -> EvaluatedArm:
    def percent(part: int, whole: int) -> float | None:
        return round(100.0 * part / whole, 2) if whole else None

    def mean(name: str) -> float:
        return round(sum(getattr(s, name) for s in scores) / len(scores), 2)

    return EvaluatedArm(
        task=task,
        arm=arm,
        trials=len(scores),
        success=percent(sum(s.success for s in scores), len(scores)) or 0.0,
        step_success=percent(sum(s.executed for s in scores), sum(s.executions for s in scores)),
        recovery=percent(sum(s.recovered for s in scores), sum(s.replanned for s in scores)),
        false_success=percent(sum(s.claimed and not s.success for s in scores), len(scores)) or 0.0,
        calls=mean("calls"),
        seconds=mean("seconds"),
        metres=mean("metres"),
    )


def as_markdown(file: AgentEvaluationFile) -> str:
    """Return the results as a table."""
    lines = [
        "The brain is rules of ours, no language model. SR: tasks done; SSR: executions that did what they were to do; "
        "RR: of those tried again after a failure.",
        "",
        "| task | arm | trials | SR % | SSR % | RR % | false success % | calls | seconds | metres |",
        "|---|---|---|---|---|---|---|---|---|---|",
    ]

    def shown(value: float | None) -> str:
        return "-" if value is None else f"{value:.1f}"

    for r in file.rows:
        lines.append(
            f"| {r.task} | `{r.arm}` | {r.trials} | {shown(r.success)} | {shown(r.step_success)} | {shown(r.recovery)} "
            f"| {shown(r.false_success)} | {r.calls:.1f} | {r.seconds:.0f} | {r.metres:.0f} |"
        )
    return "\n".join(lines) + "\n"
