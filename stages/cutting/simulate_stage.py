"""The step `cutting simulate`: objects and goal of a plan, cut on a board, each cut planned from what lies there."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import closing

import numpy as np
from scenewright.schemas.cutting_model import CuttingModel
from scenewright.schemas.cutting_plan import CuttingPlan, CuttingPlanFile, CuttingTrial, CuttingTrialFile
from scenewright.schemas.errors import BadInput, UsageError
from scenewright.stages.cutting.board import Board, laid_out
from scenewright.stages.cutting.bodies_file import read_bodies, write_bodies
from scenewright.stages.cutting.measure.scores import score
from scenewright.stages.cutting.methods import Learned, read_learned
from scenewright.stages.cutting.ours.imagining import Wish, imagine
from scenewright.stages.cutting.ours.items import Item
from scenewright.stages.cutting.ours.policy import DOUBT
from scenewright.stages.cutting.parameters import SimulateParameters
from scenewright.stages.cutting.pictures import animate, apart, draw, strip
from scenewright.stages.cutting.plan_stage import scores_record
from scenewright.stages.cutting.policy import Goal, Policy, carry_out
from scenewright.stages.cutting.sight.laying import BETWEEN, ROW, Hand, in_rows
from scenewright.stages.cutting.sight.perceiving import PerceivingPolicy
from scenewright.stages.cutting.sight.pictured import write_pictures
from scenewright.stages.cutting.sight.seeing import DOUBT as SEEN_DOUBT
from scenewright.stages.cutting.sight.views import look
from scenewright.stages.cutting.verdict import verdict, words_met
from scenewright.stages.cutting.words import read_words
from scenewright.stages.cutting.world.body import Body
from scenewright.stages.kit.stage import Context


def run(plan: CuttingPlan, model: CuttingModel, *, parameters: SimulateParameters, context: Context) -> CuttingTrial:
    """Cut in physics."""
    file = plan.info
    bodies = read_bodies(plan.path("bodies.npz"))
    if len(bodies) < file.objects + file.goal_bodies:
        raise BadInput(f"{plan.root}: has {len(bodies)} bodies, fewer than its objects and goal", hint="plan again")
    objects, goal = laid_out(bodies[: file.objects]), bodies[file.objects : file.objects + file.goal_bodies]
    learned = read_learned(model)
    wish = None if goal else imagine(objects, read_words(file.goal), learned.grammar)
    policy = _policy(learned, file, goal, wish, parameters, context.seed)
    frames: list[Mapping[int, Body]] = []
    with closing(Hand() if parameters.cameras else Board()) as table, context.progress.step("cut"):
        board = table.board if isinstance(table, Hand) else table

        def lie(there: dict[int, Body]) -> None:
            if isinstance(table, Hand):
                table.lay(there)
                frames.append(dict(zip(there, in_rows(list(there.values()), ROW, BETWEEN), strict=True)))
            else:
                table.rest(there)
                frames.append(dict(there))

        start = dict(enumerate(objects))
        lie(start)
        most = len(file.wanted) + (parameters.method == "ours")
        carving = carry_out(policy, list(start.values()), most=most, lie=lie)
        if isinstance(table, Hand):
            laid = table.lay_out(carving.fragments)
            write_pictures(context.output / "seen", look(laid, context.random(2)), laid)
    scores = scores_record(score(carving.fragments, goal)) if goal else None
    words = words_met(wish, carving) if wish is not None else ()
    outcome, said = verdict(carving, len(file.wanted), scores, words)
    statement = f"{len(carving.steps)} cuts left {len(carving.board)} fragments, {len(file.wanted)} were wanted"
    if board.fallen:
        outcome = "not_reached"
        statement += f"; {len(board.fallen)} fell off the board"
    if parameters.cameras:
        statement += "; planned from what two depth cameras saw"
    statement = "; ".join([statement, *said])
    CuttingTrialFile(
        method=parameters.method,
        goal=file.goal,
        cuts=len(carving.steps),
        fragments=len(carving.board),
        wanted=len(file.wanted),
        refusals=tuple(carving.refusals),
        stopped=carving.stopped,
        scores=scores,
        words=words,
        fallen=len(board.fallen),
        missed=policy.missed if isinstance(policy, PerceivingPolicy) else None,
        turned=float(np.mean(board.turned)) if board.turned else 0.0,
        statement=statement,
    ).write(context.output / "trial.json")
    write_bodies(context.output / "bodies.npz", carving.fragments)
    with context.progress.step("pictures"):
        width = parameters.image_width // 3
        images = [
            draw(frames[0], width, "before"),
            draw(frames[-1], width, "laid apart to be seen" if parameters.cameras else "as the fragments lie"),
        ]
        if not parameters.cameras:
            images.append(draw(apart(carving.board), width, "fragments apart"))
        strip(images).save(context.output / "board.png")
        animate(context.output / "board.gif", frames, width, [f"{k} cuts" for k in range(len(frames))])
    summary: dict[str, object] = {
        "method": parameters.method,
        "cuts": len(carving.steps),
        "fragments": len(carving.board),
    }
    if scores is not None:
        summary["iou"] = round(scores.iou, 3)
    if outcome != "ok":
        summary["reason"] = statement
    return CuttingTrial(root=context.output, outcome=outcome, summary=summary)


def _policy(
    learned: Learned,
    file: CuttingPlanFile,
    goal: list[Body],
    wish: Wish | None,
    parameters: SimulateParameters,
    seed: int,
) -> Policy:
    method = parameters.method
    if goal and method != "ours":
        return learned.policy(method, Goal(tuple(goal)), seed)
    if method != "ours":
        raise UsageError(f"--method {method} cuts towards fragments, the plan's goal is words", hint="--method ours")
    items = [Item(k, fragment.edges, fragment.volume) for k, fragment in enumerate(file.wanted)]
    if parameters.cameras:
        return PerceivingPolicy(learned.grammar, items, seed, doubt=max(SEEN_DOUBT, file.doubt or 0.0))
    return learned.policy_for(wish or items, doubt=file.doubt or DOUBT)
