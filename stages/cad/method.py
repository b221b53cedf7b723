"""What a method of replacing objects by CAD models decides. The table of methods is in stage.py."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

from scenewright.schemas.cad_scene import Way
from scenewright.schemas.panoptic_map import PanopticMap
from scenewright.stages.cad.alignment import AlignmentWeights
from scenewright.stages.cad.arranging import Placer
from scenewright.stages.cad.free_space import FreeSpace
from scenewright.stages.cad.model_surfaces import ModelSurface
from scenewright.stages.cad.parameters import CadParameters
from scenewright.stages.cad.shapes import Placement
from scenewright.stages.cad.target import Target


@dataclass(frozen=True)
class Proposals:
    """Placed models of one object, with alignment error and score."""

    placements: list[Placement]
    rejected: Counter[str]
    """Why others are none, and how many."""


class CadMethod(Protocol):
    """The decisions in which methods differ; the global check and the walk down the tree are the same for all."""

    @property
    def parameters(self) -> CadParameters:
        """Options of the step."""
        ...

    @property
    def corrects(self) -> bool:
        """Whether what the thesis leaves out counts: nameless surface, a closed shell, the room's light, and grounds on
        which a joint is believed."""
        ...

    @property
    def ways(self) -> tuple[Way, ...]:
        """The ways in which something is sought that may stand for a thing, in order (`tries.SEEKERS`)."""
        ...

    @property
    def least_explained(self) -> float:
        """Share of the surface of its thing under which a model is none any more."""
        ...

    def free_space(self, panoptic_map: PanopticMap) -> FreeSpace:
        """Return what the method wants to know of seen empty space."""
        ...

    def propose(self, target: Target) -> Proposals:
        """Return placed models (sections 2.4.2 and 2.4.3): matched, aligned, measured and scored."""
        ...

    def misfit(self, target: Target) -> float:
        """Return how far the best of a target's models is off where its planes put it [m]; infinite without any."""
        ...

    def why_invalid(self, placement: Placement, target: Target) -> str | None:
        """Return why a placement is no candidate whatever it carries, or None."""
        ...

    def missing_allowed(self, missing: Sequence[int]) -> int:
        """Return how many children without a surface a candidate may have; `missing`: how many each of them has."""
        ...

    def eligible(self, scores: Sequence[float]) -> int:
        """Return how many of an object's candidates, by ascending score, the global check may choose from."""
        ...

    def placer(self, alternatives: Mapping[str, Sequence[Placement]], surfaces: Mapping[str, ModelSurface]) -> Placer:
        """Return how chosen models are put into the scene. `alternatives`: node -> what may take its model's place."""
        ...


def matching_weights(parameters: CadParameters) -> tuple[float, float, float]:
    """Return omega_1 to omega_3 of the matching error (2.7)."""
    return parameters.size_weight, parameters.plane_weight, parameters.upright_weight


def alignment_weights(parameters: CadParameters) -> AlignmentWeights:
    """Return the diagonals of (2.12)."""
    return AlignmentWeights(
        parameters.support_weight,
        parameters.offset_weight,
        parameters.angle_weight,
        parameters.containment_weight,
        parameters.height_weight,
    )
