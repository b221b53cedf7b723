"""Open the encoder that the options ask for."""

from __future__ import annotations

from pathlib import Path

from scenewright.schemas.errors import MissingDependency
from scenewright.stages.kit.open_words.encoder import Encoder
from scenewright.stages.kit.open_words.options import EncoderParameters


def open_encoder(parameters: EncoderParameters, weights: Path | None, device: str = "cpu") -> Encoder:
    """Return an encoder. Raises MissingDependency, BadInput, MachineFailure as it may."""
    if parameters.encoder == "huggingface":
        from scenewright.stages.kit.open_words.transformers_encoder import TransformersEncoder

        if weights is None:
            raise MissingDependency(
                "--encoder huggingface needs a model",
                hint="give a folder or hub id with --weights, for example openai/clip-vit-base-patch16",
            )
        return TransformersEncoder(weights, device)
    if parameters.encoder == "service":
        from scenewright.stages.kit.open_words.service_encoder import ServiceEncoder

        return ServiceEncoder(parameters.encoder_address)
    from scenewright.stages.kit.open_words.embedded import BUNDLED, EmbeddedEncoder

    return EmbeddedEncoder(BUNDLED if weights is None else weights)
