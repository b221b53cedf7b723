"""Backend `masks`: masks that somebody's own network wrote into a folder (docs/MASKS.md)."""

from __future__ import annotations

from typing import Literal

from pydantic import Field
from scenewright.stages.kit.labels import LABEL_TABLES
from scenewright.stages.kit.stage import Parameters
from scenewright.stages.segment.registry import BackendDeclaration


class MasksParameters(Parameters):
    """Options of the backend `masks`."""

    masks_model: str = Field(
        "", max_length=500, description="Whose masks those of --masks are, for the label (default: the folder's name)"
    )
    masks_tolerance: float = Field(
        0.02, ge=0, description="Masks with a time stamp belong to the frame at most this far from it [s]"
    )
    masks_named_like: Literal["auto", "log", "sequence"] = Field(
        "auto",
        description="Masks are named like the log's images (log), or by numbers of the sequence's frames (sequence); "
        "auto takes the log's names where masks have them",
    )


BACKEND = BackendDeclaration(
    name="masks",
    summary="the masks of a folder (--masks), made by a network of one's own",
    order=75,
    parameters=MasksParameters,
    exclusive=("masks_model", "masks_tolerance", "masks_named_like"),
    data_files=lambda parameters: LABEL_TABLES,
)
