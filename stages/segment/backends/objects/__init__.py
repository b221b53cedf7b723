"""Backend `objects`: class-agnostic objects of one RGB-D frame: arrays in, labels out."""

from __future__ import annotations

from typing import Literal

from pydantic import Field
from scenewright.stages.kit.stage import Parameters
from scenewright.stages.segment.registry import BackendDeclaration


class ObjectsParameters(Parameters):
    """Options of the backend `objects`."""

    grouping: Literal["learned", "rules"] = Field(
        "learned", description="What tells --backend objects which patches are one object: trained trees, or set rules"
    )
    largest_object: float = Field(
        0.6, gt=0, description="What is larger across is not an object for --backend objects [m]"
    )


def _trees(parameters: ObjectsParameters) -> tuple[str, ...]:
    return ("networks/tabletop_pairs.safetensors",) if parameters.grouping == "learned" else ()


BACKEND = BackendDeclaration(
    name="objects",
    summary="whole objects from geometry and colour, each an `object`",
    order=30,
    parameters=ObjectsParameters,
    data_files=_trees,
)
