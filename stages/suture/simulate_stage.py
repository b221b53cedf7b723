"""The step `suture simulate`: trials of the state machine, one of them recorded with its motions."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.schemas.suture_trial import SutureEvent, SuturePerception, SutureRun, SutureTrial, SutureTrialFile
from scenewright.stages.kit.stage import Context
from scenewright.stages.suture.motion.constants import THROWS
from scenewright.stages.suture.parameters import SimulateParameters
from scenewright.stages.suture.trials.machine import run_trial
from scenewright.stages.suture.trials.perception import FOLDER, PerceptionModel, perception_model
from scenewright.stages.suture.trials.policies import POLICIES
from scenewright.stages.suture.trials.recording import Recorder
from scenewright.stages.suture.trials.records import run_of
from scenewright.stages.suture.trials.settings import World

if TYPE_CHECKING:
    from scenewright.stages.suture.trials.sight import LookingEyes

PANELS_SHOWN = 18
"""Most pictures of the strip; by eye."""
CLASSES = {"I": "insertion", "E": "extraction", "H": "handover", "T": "thread"}


def run(perception: Path | None, *, parameters: SimulateParameters, context: Context) -> SutureTrial:
    """Run every arm on the same seeds. The outcome of a single trial that did not close the wound is `not_closed`."""
    world = World()
    models = {arm: _model(arm, perception) for arm in parameters.arms}
    recorder = Recorder()
    runs: list[SutureRun] = []
    recorded = (context.seed, parameters.record or parameters.arms[0])
    pairs = [(seed, arm) for seed in range(context.seed, context.seed + parameters.trials) for arm in parameters.arms]
    for seed, arm in context.progress.track(pairs, total=len(pairs), description="trials"):
        recorder_of_trial = recorder if (seed, arm) == recorded else None
        eyes = _eyes(models[arm], seed, parameters.sight)
        runs.append(run_of(arm, seed, run_trial(POLICIES[arm], seed, world, models[arm], recorder_of_trial, eyes)))
    statement = _statement(runs)
    SutureTrialFile(
        statement=statement,
        runs=tuple(runs),
        perception=tuple(_perception(arm, model, parameters.sight) for arm, model in models.items()),
        world={name: float(value) for name, value in asdict(world).items()},
        recorded_arm=recorded[1],
        recorded_seed=recorded[0],
        events=tuple(
            SutureEvent(seconds=round(seconds, 3), suture=suture, what=panel)
            for seconds, suture, panel in zip(recorder.seconds, recorder.sutures, recorder.panels, strict=True)
        ),
    ).write(context.output / "trial.json")
    context.output.joinpath("trial.txt").write_text(
        trial_text(statement, runs, models, recorder, recorded, parameters.sight), encoding="utf-8"
    )
    recorder.write(context.output / "frames.npz")
    np.savez_compressed(context.output / "motions.npz", allow_pickle=False, **recorder.motions())
    with context.progress.step("strip"):
        from scenewright.stages.suture.trials.drawing import draw_strip

        draw_strip(context.output / "strip.png", recorder.arrays(), most=PANELS_SHOWN)
    summary: dict[str, object] = {
        "trials": len(runs),
        "arms": " ".join(parameters.arms),
        "sutures": sum(run.sutures for run in runs),
        "attempts": sum(run.attempts for run in runs),
        "errors": "".join(run.errors for run in runs)[:40],
    }
    failed = len(runs) == 1 and runs[0].sutures < THROWS
    if failed:
        summary["reason"] = statement
    return SutureTrial(root=context.output, outcome="not_closed" if failed else "ok", summary=summary)


def _model(arm: str, given: Path | None) -> PerceptionModel:
    """Return how an arm sees: the user's error model, or the arm's own. Raises BadInput for a file that is none."""
    if given is not None:
        if given.is_dir():
            raise BadInput(f"{given}: a folder is not a perception model", hint="give a TOML file")
        return perception_model(given)
    return perception_model(FOLDER / f"perception_{POLICIES[arm].perception}.toml")


def _eyes(model: PerceptionModel, seed: int, sight: str) -> LookingEyes | None:
    if sight == "model":
        return None
    from scenewright.stages.suture.trials.sight import LookingEyes

    return LookingEyes(model, seed, sight == "pictures")


def _perception(arm: str, model: PerceptionModel, sight: str) -> SuturePerception:
    """Return what is said of how an arm sees."""
    if sight == "model":
        provenance = " ".join(model.provenance.split())
        return SuturePerception(arm=arm, model=model.name, measured=model.measured, provenance=provenance)
    from scenewright.stages.suture.needle.estimators import ESTIMATORS
    from scenewright.stages.suture.trials.sight import SIGHTS

    whose = ESTIMATORS[model.name].whose
    return SuturePerception(arm=arm, model=sight, measured=True, provenance=f"{whose}: {SIGHTS[sight]}")


def _statement(runs: list[SutureRun]) -> str:
    if len(runs) > 1:
        thrown = sum(run.sutures for run in runs)
        closed = sum(run.sutures >= THROWS for run in runs)
        return f"{len(runs)} trials threw {thrown} sutures; {closed} closed the wound"
    (run,) = runs
    text = f"{run.arm}, seed {run.seed}: {run.sutures} of {THROWS} sutures in {run.seconds:.0f} s"
    return text + (f"; ended by {failure_of(run)}" if run.sutures < THROWS and run.errors else "")


def failure_of(run: SutureRun) -> str:
    """Return what ended a trial, with its class: `I (insertion): ...`; empty where nothing did."""
    if not run.errors or run.sutures >= THROWS:
        return ""
    kind = run.errors[-1]
    return f"{kind} ({CLASSES[kind]}): {run.reasons[-1]}"


def trial_text(
    statement: str,
    runs: list[SutureRun],
    models: dict[str, PerceptionModel],
    recorder: Recorder,
    recorded: tuple[int, str],
    sight: str = "model",
) -> str:
    """Return the trials as people read them; `recorded` are seed and arm of the recorded one."""
    lines = [statement, ""]
    lines += [
        f"{arm} sees by {sight_record.model} ({'measured' if sight_record.measured else 'ASSUMED'})"
        for arm, sight_record in ((arm, _perception(arm, model, sight)) for arm, model in models.items())
    ]
    lines += ["", f"recorded: {recorded[1]}, seed {recorded[0]}"]
    lines += [
        f"{seconds:8.1f} s  suture {suture + 1}  {panel}"
        for seconds, suture, panel in zip(recorder.seconds, recorder.sutures, recorder.panels, strict=True)
    ]
    lines += ["", "arm                seed  sutures  seconds  errors  ended by"]
    lines += [
        f"{run.arm:18} {run.seed:4}  {run.sutures:7}  {run.seconds:7.0f}  {run.errors or '-':6}  "
        f"{failure_of(run) or ('the wound is closed' if run.sutures >= THROWS else '-')}"
        for run in runs
    ]
    return "\n".join(lines) + "\n"
