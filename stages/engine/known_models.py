"""Networks that people bring: source, licence and checksum (data/models.toml)."""

from __future__ import annotations

import os
import tomllib
from pathlib import Path

from scenewright.schemas.base import Model
from scenewright.schemas.errors import BadInput
from scenewright.schemas.places import data_file
from scenewright.stages.kit.digests import sha256_of_file

MODELS_FILE = data_file("models.toml")


class KnownModel(Model):
    """One network."""

    name: str
    purpose: str
    file: str
    source: str
    licence: str
    sha256: str


def known_models() -> tuple[KnownModel, ...]:
    """Read data/models.toml."""
    with MODELS_FILE.open("rb") as file:
        return tuple(KnownModel(**row) for row in tomllib.load(file)["model"])


def identify(path: Path) -> KnownModel:
    """Return the known network whose checksum a file has. Raises BadInput when it is none of them."""
    if not os.path.isfile(path):
        raise BadInput(f"{path}: no such file", hint="see: scenewright models")
    digest = sha256_of_file(path)
    for model in known_models():
        if model.sha256 == digest:
            return model
    raise BadInput(f"{path}: sha256 {digest[:12]}... is not a network listed here", hint="see: scenewright models")
