"""Backend `huggingface`: published panoptic and open-vocabulary models, through the transformers library."""

from __future__ import annotations

from pydantic import Field
from scenewright.stages.kit.labels import LABEL_TABLES
from scenewright.stages.kit.stage import Extra, Parameters
from scenewright.stages.segment.registry import BackendDeclaration


class HuggingFaceParameters(Parameters):
    """Options of the backend `huggingface`."""

    words: str = Field(
        "",
        description="What an open-vocabulary model looks for: `cup, table, blue mug = cup`; a word without a class "
        "gets that of its name or synonym, else `object`",
    )


BACKEND = BackendDeclaration(
    name="huggingface",
    summary="a panoptic or open-vocabulary model of the transformers library",
    order=60,
    needs=frozenset({"color"}),
    of_pictures=True,
    weights="a model folder or hub id",
    parameters=HuggingFaceParameters,
    libraries=("transformers", "torch", "tokenizers", "pillow"),
    extras=(
        Extra(
            "transformers",
            "transformers",
            "segment --backend huggingface: pip install transformers (without torchvision)",
        ),
    ),
    data_files=lambda parameters: LABEL_TABLES,
)
