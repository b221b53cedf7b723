"""Backend `ground-truth`: the labels stream of a generated log, corrupted on request."""

from __future__ import annotations

from typing import Literal

from pydantic import Field
from scenewright.stages.kit.stage import Parameters
from scenewright.stages.segment.registry import BackendDeclaration


class GroundTruthParameters(Parameters):
    """Options of the backend `ground-truth`."""

    corruption: float = Field(
        0.0, ge=0, le=1, description="Level of the errors put into ground-truth masks (0 none; part of every name)"
    )
    lasting: Literal["none", "detector", "network"] = Field(
        "none", description="Errors that last from frame to frame instead, at the rates of a segmenter on real frames"
    )


def _rates(parameters: GroundTruthParameters) -> tuple[str, ...]:
    return () if parameters.lasting == "none" else ("errors/segmenters.toml",)


BACKEND = BackendDeclaration(
    name="ground-truth",
    summary="the log's own labels",
    order=10,
    apart=True,
    needs=frozenset({"labels"}),
    parameters=GroundTruthParameters,
    data_files=_rates,
    exclusive=("corruption", "lasting"),
)
