"""The step `cutting learn`: what every method asked for learns from the training trials."""

from __future__ import annotations

from scenewright.schemas.cutting_demonstrations import CuttingDemonstrations
from scenewright.schemas.cutting_model import CuttingModel, CuttingModelFile
from scenewright.schemas.errors import BadInput
from scenewright.stages.cutting.demonstrations.records import read_demonstrations
from scenewright.stages.cutting.methods import learn_methods, productions_of, write_networks
from scenewright.stages.cutting.ours.records import grammar_record
from scenewright.stages.cutting.parameters import METHODS, LearnParameters
from scenewright.stages.kit.stage import Context


def run(demonstrations: CuttingDemonstrations, *, parameters: LearnParameters, context: Context) -> CuttingModel:
    """Learn."""
    everything = read_demonstrations(demonstrations)
    marked = [record.training for record in demonstrations.info.trials]
    trials = [trial for trial, training in zip(everything, marked, strict=True) if training]
    try:
        with context.progress.step("learn"):
            learned = learn_methods(trials, parameters.methods, context.seed, context.logger.info)
    except ValueError as error:
        raise BadInput(f"{demonstrations.root}: nothing to learn from: {error}", hint="record more trials") from None
    unfinished = sum(not trial.finished for trial in trials)
    cuts, pieces = sum(len(trial.cuts) for trial in trials), sum(len(trial.pieces) for trial in trials)
    grammar = learned.grammar
    methods = tuple(name for name in METHODS if name == "ours" or name in parameters.methods)
    statement = f"{grammar.types} types and {len(grammar.rules)} rules out of {cuts} cuts of {len(trials)} trials"
    if unfinished:
        statement += f"; {unfinished} of them stop midway: they teach how things are cut, not what is wanted"
    CuttingModelFile(
        trials=len(trials),
        unfinished=unfinished,
        pieces=pieces,
        cuts=cuts,
        grammar=grammar_record(grammar),
        thesis=productions_of(learned),
        methods=methods,
        statement=statement,
    ).write(context.output / "model.json")
    write_networks(context.output / "networks.safetensors", learned)
    summary = {
        "types": grammar.types,
        "rules": len(grammar.rules),
        "bits": round(grammar.bits, 1),
        "trials": len(trials),
    }
    return CuttingModel(root=context.output, summary=summary)
