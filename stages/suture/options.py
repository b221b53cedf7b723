"""Options that the commands of suture share. Cheap to import."""

from __future__ import annotations

from typing import Literal

from pydantic import Field
from scenewright.stages.kit.stage import Parameters

CHECKPOINT = "stitch/segmentation.safetensors"
"""File of the segmenter that is shipped, below data/."""
ArmName = Literal["sensing_only", "thread_handling", "thesis", "thesis_supervised", "ours", "ours_supervised"]
HolderName = Literal["any", "air", "left", "right", "both", "tissue"]
PlaceName = Literal["any", "wound", "left", "right", "high", "corner"]
ARM_NAMES: tuple[str, ...] = ArmName.__args__  # type: ignore[attr-defined]


class MaskOptions(Parameters):
    """Where the masks of needle and thread come from."""

    segmentation: Literal["auto", "network", "files", "truth", "spoiled"] = Field(
        "auto",
        description="Masks: a `network` (--segmenter, or the shipped one), `files` (--masks), a scene's "
        "`truth`, or that `spoiled` with errors; `auto`: --masks where given, else the network",
    )
    pictures: int = Field(6, ge=0, le=200, description="Frames that are drawn")
