"""CAD replacement as the thesis words it: matching, alignment and check of section 2.4 (Han 2024)."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from scenewright.schemas.cad_scene import Way
from scenewright.schemas.panoptic_map import PanopticMap
from scenewright.stages.cad.alignment import align
from scenewright.stages.cad.arranging import Placer, Standing
from scenewright.stages.cad.free_space import NOTHING_KNOWN, FreeSpace
from scenewright.stages.cad.matching import rank_matches
from scenewright.stages.cad.method import Proposals, alignment_weights, matching_weights
from scenewright.stages.cad.model_surfaces import ModelSurface, alignment_error
from scenewright.stages.cad.parameters import CadParameters
from scenewright.stages.cad.placing import placement_of
from scenewright.stages.cad.shapes import Placement, shape_of_state
from scenewright.stages.cad.target import Target, scale_fits, stands_in_wall


@dataclass(frozen=True)
class Thesis:
    """The baseline (`CadMethod`). Whoever corrects something does it in ours.py."""

    parameters: CadParameters

    @property
    def corrects(self) -> bool:
        """Nothing of it: what has a node is there as it was mapped, and what a model can do, the thing can."""
        return False

    @property
    def ways(self) -> tuple[Way, ...]:
        """It takes the class from the masks, and the library's models at one scale (2.10)."""
        return ("library",)

    @property
    def least_explained(self) -> float:
        """What was chosen stays."""
        return 0.0

    def free_space(self, panoptic_map: PanopticMap) -> FreeSpace:
        """Seen empty space has no say."""
        return NOTHING_KNOWN

    def propose(self, target: Target) -> Proposals:
        """Match every stored state by planes and size, align by planes, measure on the vertices."""
        parameters = self.parameters
        matches, counts = rank_matches(
            target.frames(all_frames=False),
            [shape_of_state(model, state) for model in target.models for state in model.states],
            weights=matching_weights(parameters),
            unmatched=None,
            scale_range=(parameters.minimum_scale, parameters.maximum_scale),
            keep=parameters.candidates,
        )
        rejected = Counter(counts)
        weights = alignment_weights(parameters)
        placements = []
        for match in matches:
            placement = placement_of(match, align(match, weights, parameters.evaluations))
            if not scale_fits(placement, parameters):
                rejected["aligned scale out of range"] += 1
                continue
            error = alignment_error(target.surfaces[match.shape.model.id], placement, target.points)
            placements.append(replace(placement, alignment_error=error, score=error))
        return Proposals(placements, rejected)

    def misfit(self, target: Target) -> float:
        """No other class promises anything."""
        return math.inf

    def why_invalid(self, placement: Placement, target: Target) -> str | None:
        """Scale and walls."""
        if not scale_fits(placement, self.parameters):
            return "refined scale out of range"
        return "stands in a wall" if stands_in_wall(placement, target, self.parameters) else None

    def missing_allowed(self, missing: Sequence[int]) -> int:
        """A candidate that one child has no surface on is none."""
        return 0

    def eligible(self, scores: Sequence[float]) -> int:
        """All."""
        return len(scores)

    def placer(self, alternatives: Mapping[str, Sequence[Placement]], surfaces: Mapping[str, ModelSurface]) -> Placer:
        """Every model stands on its support and stays where the alignment put it."""
        return Standing(surfaces)
