"""The step `cutting demonstrate`: trials as planes, the scripted cutter's of all cells or a person's."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

from PIL import Image
from scenewright.schemas.cutting_demonstrations import (
    CuttingDemonstrations,
    CuttingDemonstrationsFile,
    DemonstrationRecord,
)
from scenewright.schemas.errors import BadInput
from scenewright.stages.cutting.bodies_file import write_bodies
from scenewright.stages.cutting.demonstrations.cutter import Demonstration, Scatter
from scenewright.stages.cutting.demonstrations.records import record_of
from scenewright.stages.cutting.demonstrations.trials import is_for_training, make_trials
from scenewright.stages.cutting.parameters import DemonstrateParameters
from scenewright.stages.cutting.pictures import apart, draw, strip
from scenewright.stages.cutting.recording.session import read_recording
from scenewright.stages.kit.stage import Context


def run(record: Path | None, *, parameters: DemonstrateParameters, context: Context) -> CuttingDemonstrations:
    """Let the scripted cutter cut, or carry out again what a person cut."""
    with context.progress.step("cut"):
        if record is not None:
            recorded, trials = read_recording(record)
            if not trials:
                raise BadInput(f"{record}: nothing was cut", hint="cut something: scenewright cutting record FILE")
            records = [each.trial for each in recorded]
        else:
            scatter = Scatter(tilt=parameters.tilt, spacing=parameters.spacing)
            trials = make_trials(context.seed, scatter, parameters.share)
            records = _scripted_records(trials)
    training = sum(each.training for each in records)
    statement = f"{len(trials)} trials, {training} of them to learn from, {sum(len(t.cuts) for t in trials)} cuts"
    if record is not None:
        statement += f"; cut by a person, {sum(not trial.finished for trial in trials)} not finished"
    CuttingDemonstrationsFile(
        seed=context.seed,
        tilt=parameters.tilt if record is None else None,
        spacing=parameters.spacing if record is None else None,
        trials=tuple(records),
        statement=statement,
    ).write(context.output / "demonstrations.json")
    write_bodies(context.output / "objects.npz", [body for trial in trials for body in trial.objects])
    with context.progress.step("pictures"):
        _draw(trials, parameters.image_width // 4).save(context.output / "sheet.png")
    summary = {"trials": len(trials), "training": training, "cuts": sum(len(trial.cuts) for trial in trials)}
    return CuttingDemonstrations(root=context.output, summary=summary)


def _scripted_records(trials: list[Demonstration]) -> list[DemonstrationRecord]:
    of_cell = Counter(trial.cell for trial in trials)
    trials_of_cell: Counter[str] = Counter()
    records = []
    for trial in trials:
        records.append(record_of(trial, is_for_training(trial.cell, trials_of_cell[trial.cell], of_cell[trial.cell])))
        trials_of_cell[trial.cell] += 1
    return records


def _draw(trials: list[Demonstration], width: int) -> Image.Image:
    """Return the first trial of each cell, before and after."""
    images = []
    first: dict[str, Demonstration] = {}
    for trial in trials:
        first.setdefault(trial.cell, trial)
    for trial in first.values():
        names = ", ".join(sorted(set(trial.categories.values()))) or "not finished"
        images.append(draw(dict(enumerate(trial.objects)), width, f"{trial.cell}: {', '.join(trial.families)}"))
        images.append(draw(apart({n: trial.pieces[n] for n in trial.final}), width, f"{len(trial.final)}: {names}"))
    return strip(images)
