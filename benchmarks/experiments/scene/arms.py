"""The arms and cases of `make bench-scene`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from scenewright.stages.cad import CadParameters
from scenewright.stages.graph import GraphParameters

from benchmarks.experiments.mapping.arms import DRIFTING as DRIFTING_POSES
from benchmarks.experiments.mapping.arms import ESTIMATED as ESTIMATED_POSES
from benchmarks.experiments.mapping.arms import LASTING


@dataclass(frozen=True)
class Arm:
    """One way from a map to a scene."""

    name: str
    title: str
    map_arm: str
    """Arm of `make bench-mapping` whose map it starts from where the map is reconstructed."""
    graph: GraphParameters
    cad: CadParameters


THESIS: dict[str, object] = {"method": "thesis"}
OURS: dict[str, object] = {"method": "ours"}
RELEASED: dict[str, object] = {"candidates": 20, "area_threshold": 0.3, "minimum_scale": 0.3, "maximum_scale": 3.0}
"""Where the released code is more lenient than the text: candidates, overlap with children; and no scale of a candidate
is dropped that ours would have clipped."""


def _arm(name: str, title: str, map_arm: str, graph: Mapping[str, object], cad: Mapping[str, object]) -> Arm:
    return Arm(name, title, map_arm, GraphParameters.model_validate(graph), CadParameters.model_validate(cad))


ARMS = (
    _arm("thesis", "thesis, constants of its text", "thesis", THESIS, THESIS),
    _arm("thesis_released", "thesis, constants of its code", "thesis", THESIS, THESIS | RELEASED),
    _arm("thesis_chosen", "thesis, our choices in the map", "thesis_chosen", THESIS, THESIS | RELEASED),
    _arm("thesis_on_ours", "thesis, on our map", "ours", THESIS, THESIS | RELEASED),
    _arm("ours_on_thesis", "ours, on the thesis's map", "thesis", OURS, OURS),
    _arm(
        "best_single", "ours without the global check", "ours", OURS, {"conflict_iterations": 0, "maximum_shift": 0.0}
    ),
    _arm("ours", "ours", "ours", OURS, OURS),
)
"""`best_single` takes what fits each object best by itself and puts it on its support. `thesis_on_ours` and
`ours_on_thesis` tell apart what the map gives from what graph and models do."""
OF_MAPS = frozenset({"thesis_chosen", "thesis_on_ours", "ours_on_thesis"})
"""Arms that differ from others by their map alone, which a perfect one has not."""

PERFECT, RECONSTRUCTED, DRIFTING, REAL = "perfect", "reconstructed", "drifting", "real"
ESTIMATED = "estimated"
PERFECT_HELD_OUT, HELD_OUT = "perfect_held_out", "held_out"
PERFECT_INDEPENDENT, INDEPENDENT = "perfect_independent", "independent"
CASES = (PERFECT, PERFECT_HELD_OUT, PERFECT_INDEPENDENT, RECONSTRUCTED, DRIFTING, ESTIMATED, HELD_OUT, INDEPENDENT)
"""Of the generated rooms. `perfect`: true surface that was seen, true labels. `reconstructed`: each arm's own map of
noisy depth and true masks with errors that last (the headline of `make bench-mapping`); `drifting`: the same with poses
that drift, `estimated` with poses that `poses` estimates from a log. `held_out`: the same maps as without it, and a
library of other shapes that lacks the styles of the room.
`independent`: such a library, and rooms by recipes outside of those of tuning, whose things are larger or smaller than
any model."""
OF_PERFECT = frozenset({PERFECT, PERFECT_HELD_OUT, PERFECT_INDEPENDENT})
OF_INDEPENDENT = frozenset({PERFECT_INDEPENDENT, INDEPENDENT})
OF_HELD_OUT = frozenset({PERFECT_HELD_OUT, HELD_OUT}) | OF_INDEPENDENT
MAPS = {
    RECONSTRUCTED: LASTING,
    HELD_OUT: LASTING,
    INDEPENDENT: LASTING,
    DRIFTING: DRIFTING_POSES,
    ESTIMATED: ESTIMATED_POSES,
}
"""Case -> case of `mapping`."""
