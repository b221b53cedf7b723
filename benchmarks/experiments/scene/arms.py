"""The arms and cases of `make bench-scene`."""

from __future__ import annotations

from dataclasses import dataclass

from stages.cad.parameters import CadParameters
from stages.graph.parameters import GraphParameters


@dataclass(frozen=True)
class Arm:
    """One way from a map to a scene."""

    name: str
    title: str
    map_arm: str
    """Arm of `make bench-mapping` whose map it starts from where the map is reconstructed."""
    graph: GraphParameters
    cad: CadParameters


ARMS = (
    Arm(
        "thesis",
        "thesis",
        "thesis",
        GraphParameters.model_validate({"method": "thesis"}),
        CadParameters.model_validate({"method": "thesis"}),
    ),
    Arm(
        "best_single",
        "ours without the global check",
        "ours",
        GraphParameters.model_validate({}),
        CadParameters.model_validate({"conflict_iterations": 0, "maximum_shift": 0.0}),
    ),
    Arm("ours", "ours", "ours", GraphParameters.model_validate({}), CadParameters.model_validate({})),
)
"""`best_single` takes what fits each object best by itself and puts it on its support."""

PERFECT, RECONSTRUCTED, HELD_OUT, REAL = "perfect", "reconstructed", "held_out_shapes", "real"
CASES = (PERFECT, RECONSTRUCTED, HELD_OUT)
"""Of the generated rooms. `perfect`: true surface that was seen, true labels. `reconstructed`: each arm's own map of
noisy depth and true masks corrupted by 0.3 (the middle level of `make bench-mapping`). `held_out_shapes`: those maps,
and a library of other shapes of the same classes."""
MASK_LEVEL = "middle"
