"""Declaration of the step `truth scenenn`."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from schemas.ground_truth import GroundTruth
from schemas.sequence import Sequence
from stages.kit.stage import External, Parameters, Stage

WORDS = "annotations/scenenn.toml"
"""Which annotated words are which class (below data/)."""


class SceneNNParameters(Parameters):
    """How an annotation is read."""

    matching: Literal["thesis", "words"] = Field(
        "thesis",
        description="When a label is of a class: `thesis` when a class's word occurs anywhere in its text, as in the "
        "thesis's code (a `table lamp` is a table); `words` when it is the last word of the text, or of nyu_class",
    )
    name: str = Field("", pattern=r"^[A-Za-z0-9_.\-]*$", description="Name of the scene; default: that of the XML file")
    maximum_unlisted: float = Field(
        0.05, ge=0, le=1, description="Largest share of the vertices whose label the XML may not list; these are void"
    )


STAGE = Stage(
    name="truth scenenn",
    version=2,
    summary="Make ground truth out of SceneNN's annotation, in the world frame of a sequence of that scene",
    parameters=SceneNNParameters,
    reads={
        "annotation": External("<scene>.xml of SceneNN"),
        "mesh": External("<scene>.ply of the same annotation, with a label per vertex"),
        "sequence": Sequence,
    },
    writes=GroundTruth,
    libraries=("numpy", "scipy", "trimesh"),
    data_files=lambda parameters: (WORDS,),
    example="scenewright truth scenenn --annotation scenenn/011/011.xml --mesh scenenn/011/011.ply "
    "--sequence outputs/011/sequence --out outputs/011/ground_truth",
)
