"""The step `cutting plan`: cuts towards a goal of bodies or words, each planned from what the last one left."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from PIL import Image
from scenewright.schemas.base import as_vector
from scenewright.schemas.cutting_demonstrations import CuttingDemonstrations
from scenewright.schemas.cutting_model import CuttingModel
from scenewright.schemas.cutting_plan import (
    CuttingPlan,
    CuttingPlanFile,
    CuttingScores,
    PlannedCut,
    WantedFragment,
    WordMet,
)
from scenewright.schemas.errors import BadInput
from scenewright.stages.cutting.bodies_file import write_bodies
from scenewright.stages.cutting.demonstrations.records import plane_record, read_demonstrations
from scenewright.stages.cutting.measure.scores import Scores, score
from scenewright.stages.cutting.methods import Learned, read_learned
from scenewright.stages.cutting.ours.grammar import Grammar
from scenewright.stages.cutting.ours.imagining import Wish, imagine
from scenewright.stages.cutting.ours.items import Item, features, item_of
from scenewright.stages.cutting.ours.policy import DOUBT
from scenewright.stages.cutting.parameters import PlanParameters
from scenewright.stages.cutting.parse_tree import draw_tree
from scenewright.stages.cutting.pictures import animate, apart, captioned, draw, strip
from scenewright.stages.cutting.policy import Carving, Goal, Step, carry_out
from scenewright.stages.cutting.sight.pictured import read_pictures
from scenewright.stages.cutting.sight.seeing import DOUBT as SEEN_DOUBT
from scenewright.stages.cutting.sight.seeing import DOUBT_OF_ONE, see
from scenewright.stages.cutting.verdict import verdict, words_met
from scenewright.stages.cutting.words import read_words
from scenewright.stages.cutting.world.body import Body
from scenewright.stages.cutting.world.canonical import axis_across, canonical
from scenewright.stages.cutting.world.foods import make_food
from scenewright.stages.cutting.world.mending import read_bodies_of, read_body
from scenewright.stages.kit.geometry.transforms import inverse
from scenewright.stages.kit.stage import Context


@dataclass(frozen=True)
class _Task:
    """What is cut into what."""

    objects: list[Body]
    goal: list[Body]
    """Empty for words."""
    items: list[Item]
    names: list[str]
    said: str
    notes: tuple[str, ...]
    wish: Wish | None = None
    """Of words."""
    doubt: float | None = None
    pictures: tuple[np.ndarray, ...] = ()
    """Colour pictures of the goal."""


def run(
    model: CuttingModel,
    demonstrations: CuttingDemonstrations | None,
    mesh: Path | None,
    goal_meshes: Path | None,
    goal_pictures: Path | None,
    *,
    parameters: PlanParameters,
    context: Context,
) -> CuttingPlan:
    """Plan, in a model of the world that cuts exactly."""
    learned = read_learned(model)
    task = _task(learned, demonstrations, mesh, goal_meshes, goal_pictures, parameters, context)
    if parameters.method == "ours":
        policy = learned.policy_for(task.wish or task.items, together=parameters.together, doubt=task.doubt or DOUBT)
    else:
        policy = learned.policy(parameters.method, Goal(tuple(task.goal)), context.seed)
    with context.progress.step("plan"):
        carving = carry_out(policy, task.objects, most=_most(parameters.method, task))
    scores = scores_record(score(carving.fragments, task.goal)) if task.goal else None
    words = words_met(task.wish, carving) if task.wish is not None else ()
    outcome, said = verdict(carving, len(task.items), scores, words)
    file = _file(task, carving, learned.grammar, scores, words, parameters.method, said)
    file.write(context.output / "plan.json")
    context.output.joinpath("plan.txt").write_text(plan_text(file), encoding="utf-8")
    write_bodies(context.output / "bodies.npz", [*task.objects, *task.goal, *carving.fragments])
    with context.progress.step("pictures"):
        _draw(context.output, task, carving, file, parameters.image_width)
    summary: dict[str, object] = {"method": parameters.method, "cuts": len(carving.steps), "wanted": len(task.items)}
    if scores is not None:
        summary["iou"] = round(scores.iou, 3)
    if outcome != "ok":
        summary["reason"] = file.statement
    return CuttingPlan(root=context.output, outcome=outcome, summary=summary)


def _most(method: str, task: _Task) -> int:
    """Ours stops by itself, with a piece more where something is left over; the others cut until there are enough."""
    return len(task.items) + 1 if method == "ours" else len(task.items)


def _task(
    learned: Learned,
    demonstrations: CuttingDemonstrations | None,
    mesh: Path | None,
    goal_meshes: Path | None,
    goal_pictures: Path | None,
    parameters: PlanParameters,
    context: Context,
) -> _Task:
    notes: list[str] = []
    goal: list[Body] = []
    goal_text, doubt = parameters.goal, None
    pictures: tuple[np.ndarray, ...] = ()
    if demonstrations is not None:
        (trial,) = read_demonstrations(demonstrations, only=parameters.trial)
        objects = trial.objects
        if not parameters.goal and goal_meshes is None and goal_pictures is None:
            goal, goal_text = trial.fragments, f"the fragments of trial {parameters.trial}"
    elif mesh is not None:
        body, mended = read_body(mesh, parameters.unit)
        objects, notes = [body], [f"{mesh.name}: {text}" for text in mended]
    else:
        objects = [make_food(parameters.food, context.random(0))]
    if goal_meshes is not None:
        goal, mended = read_bodies_of(goal_meshes, parameters.unit)
        goal_text, notes = f"{len(goal)} meshes of {goal_meshes.name}", notes + mended
    if goal_pictures is not None:
        pictures_read = read_pictures(goal_pictures)
        goal, pictures = see([view for view, _ in pictures_read]), tuple(color for _, color in pictures_read)
        if not goal:
            raise BadInput(
                f"{goal_pictures}: nothing lies on the board", hint="is the board's top z = 0 in camera.json?"
            )
        goal_text, doubt = (
            f"{len(goal)} fragments seen by {len(pictures_read)} cameras",
            SEEN_DOUBT if len(pictures_read) > 1 else DOUBT_OF_ONE,
        )
    if parameters.goal:
        wish = imagine(objects, read_words(parameters.goal), learned.grammar)
        return _Task(objects, [], wish.items, list(wish.names), goal_text, tuple(notes), wish)
    items = [item_of(body, k) for k, body in enumerate(goal)]
    return _Task(objects, goal, items, [""] * len(goal), goal_text, tuple(notes), None, doubt, pictures)


def _file(
    task: _Task,
    carving: Carving,
    grammar: Grammar,
    scores: CuttingScores | None,
    words: tuple[WordMet, ...],
    method: str,
    said: list[str],
) -> CuttingPlanFile:
    cuts = []
    for step in carving.steps:
        frame = canonical(carving.pieces[step.action.piece]).world_from_fragment
        types, chance = _rule(grammar, carving, step)
        cuts.append(
            PlannedCut(
                piece=step.action.piece,
                plane=plane_record(step.action.plane),
                in_fragment=plane_record(step.action.plane.moved(inverse(frame))),
                results=step.results,
                said=step.action.said,
                types=types,
                chance=chance,
                stroke=step.stroke,
                likeness=step.action.likeness,
            )
        )
    alike = [cut.likeness for cut in cuts if cut.likeness is not None]
    strokes = "" if carving.strokes == len(cuts) else f" in {carving.strokes} strokes"
    counted = f"{len(cuts)} cuts{strokes} make {len(carving.board)} fragments, {len(task.items)} are wanted"
    return CuttingPlanFile(
        method=method,
        goal=task.said,
        objects=len(task.objects),
        wanted=tuple(
            WantedFragment(edges=as_vector(np.array(item.edges)), volume=item.volume, name=name)
            for item, name in zip(task.items, task.names, strict=True)
        ),
        goal_bodies=len(task.goal),
        cuts=tuple(cuts),
        refusals=tuple(carving.refusals),
        stopped=carving.stopped,
        scores=scores,
        words=words,
        sure=float(np.mean(alike[: len(task.objects)])) if alike else None,
        doubt=task.doubt,
        notes=task.notes,
        statement="; ".join([counted, *said]),
    )


def _rule(grammar: Grammar, carving: Carving, step: Step) -> tuple[tuple[int, ...], float]:
    """Return the types of a piece and of what it mainly became, and how probable that is of its type."""
    largest = sorted(step.results, key=lambda number: -carving.pieces[number].volume)[:2]
    bodies = [carving.pieces[number] for number in (step.action.piece, *largest)]
    parent, first, second = (int(k) for k in grammar.type_of(features([item_of(b, 0) for b in bodies])[:, :3]))
    axis = axis_across(bodies[0], step.action.plane.normal)
    low, high = sorted((first, second))
    return (parent, low, high), 2.0 ** -grammar.rule_bits(parent, axis, (low, high))


def scores_record(scores: Scores) -> CuttingScores:
    """Return scores as a record."""
    return CuttingScores(**vars(scores))


def plan_text(file: CuttingPlanFile) -> str:
    """Return a plan as people read it: the statement, and the parse tree of cuts."""
    lines = [file.statement, f"goal: {file.goal}, planned by {file.method}"]
    if file.sure is not None:
        lines.append(f"expected overlap with what is wanted: {file.sure:.2f}")
    if file.scores is not None:
        lines.append(f"overlap: {file.scores.iou:.3f}, unmatched left out {file.scores.iou_thesis:.3f}")
    lines += [f"mended: {note}" for note in file.notes]
    lines.append("")
    by_piece = {cut.piece: cut for cut in file.cuts}
    waiting = [(number, 0) for number in reversed(range(file.objects))]
    while waiting:
        piece, depth = waiting.pop()
        cut = by_piece.get(piece)
        if cut is None:
            lines.append(f"{'  ' * depth}{piece}")
            continue
        n, d = cut.in_fragment.normal, cut.in_fragment.d
        sure = "" if cut.likeness is None else f", expected overlap {cut.likeness:.2f}"
        if cut.chance is not None:
            sure += f", type {cut.types[0]} into {cut.types[1]} and {cut.types[2]} with probability {cut.chance:.2f}"
        lines.append(
            f"{'  ' * depth}{piece}: cut at ({n[0]:.3f}, {n[1]:.3f}, {n[2]:.3f}) . x = {-1e3 * d:.1f} mm, "
            f"{cut.said}{sure}"
        )
        waiting += [(result, depth + 1) for result in reversed(cut.results)]
    return "\n".join(lines) + "\n"


def _draw(output: Path, task: _Task, carving: Carving, file: CuttingPlanFile, width: int) -> None:
    images = [
        draw(dict(enumerate(task.objects)), width // 3, "before"),
        draw(apart(carving.board), width // 3, f"after {len(carving.steps)} cuts, fragments apart"),
    ]
    if task.goal:
        images.append(draw(apart(dict(enumerate(task.goal))), width // 3, "wanted, fragments apart"))
    images += [captioned(Image.fromarray(color), width // 3, "wanted, its picture") for color in task.pictures[:1]]
    strip(images).save(output / "fragments.png")
    draw_tree(file, width).save(output / "tree.png")
    on_board = dict(enumerate(task.objects))
    frames = [dict(on_board)]
    for step in carving.steps:
        del on_board[step.action.piece]
        on_board |= {number: carving.pieces[number] for number in step.results}
        frames.append(apart(on_board))
    animate(output / "cuts.gif", frames, width // 3, [f"{k} cuts" for k in range(len(frames))])
