"""The step `cutting demonstrate`: the trials of all cells, as planes."""

from __future__ import annotations

from collections import Counter

from PIL import Image

from schemas.cutting_demonstrations import CuttingDemonstrations, CuttingDemonstrationsFile
from stages.cutting.bodies_file import write_bodies
from stages.cutting.demonstrations.cutter import Demonstration, Scatter
from stages.cutting.demonstrations.recipes import CELLS
from stages.cutting.demonstrations.records import record_of
from stages.cutting.demonstrations.trials import is_for_training, make_trials
from stages.cutting.parameters import DemonstrateParameters
from stages.cutting.pictures import apart, draw, strip
from stages.kit.stage import Context


def run(*, parameters: DemonstrateParameters, context: Context) -> CuttingDemonstrations:
    """Let the scripted cutter cut."""
    with context.progress.step("cut"):
        scatter = Scatter(tilt=parameters.tilt, spacing=parameters.spacing)
        trials = make_trials(context.seed, scatter, parameters.share)
    of_cell = Counter(trial.cell for trial in trials)
    seen: Counter[str] = Counter()
    records = []
    for trial in trials:
        records.append(record_of(trial, is_for_training(trial.cell, seen[trial.cell], of_cell[trial.cell])))
        seen[trial.cell] += 1
    training = sum(record.training for record in records)
    statement = f"{len(trials)} trials, {training} of them to learn from, {sum(len(t.cuts) for t in trials)} cuts"
    CuttingDemonstrationsFile(
        seed=context.seed, tilt=parameters.tilt, spacing=parameters.spacing, trials=tuple(records), statement=statement
    ).write(context.output / "demonstrations.json")
    write_bodies(context.output / "objects.npz", [body for trial in trials for body in trial.objects])
    with context.progress.step("pictures"):
        _draw(trials, parameters.image_width // 4).save(context.output / "sheet.png")
    summary = {"trials": len(trials), "training": training, "cuts": sum(len(trial.cuts) for trial in trials)}
    return CuttingDemonstrations(root=context.output, summary=summary)


def _draw(trials: list[Demonstration], width: int) -> Image.Image:
    """Return the first trial of each cell, before and after."""
    images = []
    for cell in CELLS:
        trial = next(trial for trial in trials if trial.cell == cell)
        names = ", ".join(sorted(set(trial.categories.values())))
        images.append(draw(dict(enumerate(trial.objects)), width, f"{cell}: {', '.join(trial.families)}"))
        images.append(draw(apart({n: trial.pieces[n] for n in trial.final}), width, f"{len(trial.final)}: {names}"))
    return strip(images)
