"""Whether fragments are what was wanted: as many, and of the shape."""

from __future__ import annotations

from collections.abc import Sequence

from scenewright.schemas.cutting_plan import CuttingScores, WordMet
from scenewright.stages.cutting.meaning import Made, is_met, judge
from scenewright.stages.cutting.ours.imagining import Wish
from scenewright.stages.cutting.policy import Carving

SHARED = 0.5
"""Mean overlap with wanted bodies from which a goal is met: a fragment has then more in common with what is wanted than
it has apart from it."""


def words_met(wish: Wish, carving: Carving) -> tuple[WordMet, ...]:
    """Return how well the fragments of a carving are what words say."""
    origin = {number: number for number in range(len(wish.laid))}
    for step in carving.steps:
        origin |= dict.fromkeys(step.results, origin[step.action.piece])
    made = [Made(body, origin[number]) for number, body in carving.board.items()]
    return judge([laid.thing for laid in wish.laid], made, wish.wanted, [laid.parts for laid in wish.laid])


def verdict(
    carving: Carving, wanted: int, scores: CuttingScores | None, words: Sequence[WordMet]
) -> tuple[str, list[str]]:
    """Return the outcome, and what there is to say of it: `ok` where count and shape are as wanted, `partial` where
    there are enough fragments that are not, `not_reached` where there are fewer."""
    said = [word.said for word in words]
    if not carving.steps and (carving.stopped is not None or len(carving.board) < wanted):
        said = []  # nothing was cut: why not says more than what the whole thing is
    if carving.stopped is not None:
        return "not_reached", [*said, f"stopped: {carving.stopped.message}"]
    if len(carving.board) < wanted:
        refused = [f"the knife refused: {carving.refusals[-1].message}"] if carving.refusals else []
        return "not_reached", [*said, *refused]
    right = len(carving.board) == wanted and is_met(words)
    if len(carving.board) > wanted:
        said.append(f"{len(carving.board) - wanted} too many")
    if scores is not None and scores.iou < SHARED:
        said.append(f"they overlap by {scores.iou:.2f} with what is wanted, at least {SHARED} is a likeness")
        right = False
    return "ok" if right else "partial", said
