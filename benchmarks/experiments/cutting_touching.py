"""How near to each other fragments may lie to be seen as what they are: from laid apart to poured on a heap."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass

import numpy as np
from scenewright.stages.cutting import CELLS, Board, Body, Hand, goal_trial, look, score, see
from scenewright.stages.cutting.sight.views import EYES
from scenewright.stages.kit.geometry.transforms import transform_from
from scipy.spatial.transform import Rotation

from benchmarks.experiment import Bench, Experiment, Trial, mean

GAPS = {f"gap{gap}": gap for gap in (50, 30, 20, 10, 5, 2)}
"""Between neighbours [mm]."""
HEAP = "heap"
ABOVE = (np.array([0.001, 0.0, 0.8]),)
ARMS = {"two_cameras": "two cameras, from opposite corners", "one_above": "one camera, straight above"}
TUNING, REPORTING = tuple(str(k) for k in range(12)), tuple(str(k) for k in range(5000, 5048))


@dataclass(frozen=True)
class Sight:
    """What was seen of the fragments of a goal."""

    count_exact: bool
    count_error: int
    iou: float
    volume: float


def measure(bench: Bench, trials: Sequence[Trial]) -> Iterator[tuple[Trial, Sight]]:
    """Yield what the cameras of an arm see of fragments that lie as the case says."""
    for trial in trials:
        number = int(trial.seed)
        fragments = goal_trial(list(CELLS)[number % len(CELLS)], number).fragments
        random = np.random.default_rng(number)
        lying = poured(fragments, random) if trial.case == HEAP else laid(fragments, 1e-3 * GAPS[trial.case])
        found = see(look(lying, random, EYES if trial.arm == "two_cameras" else ABOVE))
        seen = sum(body.volume for body in found) / sum(body.volume for body in fragments)
        iou = score(found, fragments).iou if found else 0.0
        yield trial, Sight(len(found) == len(fragments), abs(len(found) - len(fragments)), iou, seen)


def laid(fragments: Sequence[Body], gap: float) -> list[Body]:
    """Return fragments laid in rows this far apart [m]."""
    with closing(Hand()) as hand:
        return hand.lay_out(fragments, gap)


def poured(fragments: Sequence[Body], random: np.random.Generator) -> list[Body]:
    """Return fragments that fell onto one place of the board, one after the other."""
    there: dict[int, Body] = {}
    height = 0.0
    for number, body in enumerate(fragments):
        turned = body.shifted(-body.moments[0]).moved(
            transform_from(Rotation.random(random_state=int(random.integers(2**31))).as_matrix(), np.zeros(3))
        )
        low, high = turned.extent_along(np.array([0.0, 0.0, 1.0]))
        aside = random.uniform(-0.03, 0.03, 2)
        there[number] = turned.shifted(np.array([*aside, height - low]))
        height += high - low
    with closing(Board()) as board:
        board.rest(there)
    return list(there.values())


EXPERIMENT = Experiment(
    name="cutting_touching",
    title="Fragments seen that lie near to each other",
    simulated=(
        "Foods cut by the scripted cutter, laid in rows or poured onto the board in physics (convex hulls, "
        "three quarters of a second); depth pictures with the kit's noise."
    ),
    knows="Nothing but the depth pictures and where the cameras stand.",
    does_not_show="Real cameras; fragments that stick to each other.",
    arms=ARMS,
    cases=(*GAPS, HEAP),
    tuning=TUNING,
    reporting=REPORTING,
    measure=measure,
    record=Sight,
    code=dict.fromkeys(
        ARMS,
        (
            "scenewright.stages.cutting.sight.seeing",
            "scenewright.stages.cutting.sight.laying",
            "scenewright.stages.cutting.trying",
        ),
    ),
    measures={
        "count_exact": mean("count_exact"),
        "count_error": mean("count_error"),
        "iou": mean("iou"),
        "volume": mean("volume"),
    },
    quick_seeds=2,
)
