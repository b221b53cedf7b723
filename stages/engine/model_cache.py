"""Where weight files are kept: one folder, every file named by the beginning of its sha256 and its own name.

`$SCENEWRIGHT_MODELS`, else `$XDG_CACHE_HOME/scenewright/models`, else `~/.cache/scenewright/models`. Nothing is ever
downloaded: people bring the files (`scenewright models --add FILE`), steps find them by name, and some are taken where
nothing else is asked for.
"""

from __future__ import annotations

import logging
import os
import re
import secrets
import shutil
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from scenewright.schemas.errors import BadInput, MachineFailure, MissingDependency
from scenewright.stages.engine.hub_cache import find_in_hub_cache, home_folder, is_hub_id
from scenewright.stages.engine.known_models import KnownModel, known_models
from scenewright.stages.engine.store import sync_folder
from scenewright.stages.kit.digests import sha256_of_file
from scenewright.stages.kit.stage import Optionally

logger = logging.getLogger("scenewright")

ENVIRONMENT = "SCENEWRIGHT_MODELS"
PREFIX_LENGTH = 16
"""Hexadecimal digits of a sha256 in the name of a cached file."""
CACHED_NAME = re.compile(rf"(?P<prefix>[0-9a-f]{{{PREFIX_LENGTH}}})-(?P<name>[^/]+)")


@dataclass(frozen=True)
class CachedModel:
    """One weight file of the cache."""

    path: Path
    name: str
    """File name as it was added."""
    prefix: str
    """First 16 digits of its sha256."""
    bytes: int
    known: KnownModel | None
    """What data/models.toml says of it."""


def cache_folder() -> Path:
    """Return the folder; it need not exist yet."""
    folder = os.environ.get(ENVIRONMENT)
    if folder:
        return Path(folder)
    return Path(os.environ.get("XDG_CACHE_HOME") or home_folder() / ".cache") / "scenewright" / "models"


def cached_models() -> tuple[CachedModel, ...]:
    """List the cache by name; other files in the folder are passed over."""
    model_of_prefix = {model.sha256[:PREFIX_LENGTH]: model for model in known_models()}
    models = []
    folder = cache_folder()
    for path in sorted(folder.iterdir()) if folder.is_dir() else ():
        match = CACHED_NAME.fullmatch(path.name)
        if match and path.is_file():
            models.append(
                CachedModel(
                    path, match["name"], match["prefix"], path.stat().st_size, model_of_prefix.get(match["prefix"])
                )
            )
    return tuple(sorted(models, key=lambda model: (model.name, model.prefix)))


def add_model(path: Path) -> CachedModel:
    """Copy a weight file into the cache, whole or not at all; one that is there already is left as it is.

    Raises BadInput when it is missing, or bears the name of a known network without being it; MachineFailure when the
    folder cannot be written.
    """
    path = Path(path)
    if not os.path.isfile(path):
        raise BadInput(f"{path}: no such file", hint="give a weight file")
    digest = sha256_of_file(path)
    for model in known_models():
        if path.name == model.file and digest != model.sha256:
            raise BadInput(
                f"{path}: sha256 {digest[:12]}... is not that of {model.name} ({model.sha256[:12]}...)",
                hint=f"get it from {model.source}, or rename it if it is another network",
            )
    target = cache_folder() / f"{digest[:PREFIX_LENGTH]}-{path.name}"
    try:
        _copy(path, target, digest)
    except OSError as error:
        raise MachineFailure(f"{target}: {error.strerror}", hint=f"set {ENVIRONMENT} to a writable folder") from None
    return next(model for model in cached_models() if model.path == target)


def _copy(source: Path, target: Path, digest: str) -> None:
    if target.is_file() and sha256_of_file(target) == digest:
        return
    target.parent.mkdir(parents=True, exist_ok=True)
    partial = target.with_name(f".{target.name}.{secrets.token_hex(4)}")
    try:
        shutil.copyfile(source, partial)
        if sha256_of_file(partial) != digest:
            raise BadInput(f"{source}: changed while it was copied", hint="add it again")
        with partial.open("rb") as file:
            os.fsync(file.fileno())
        os.replace(partial, target)
        sync_folder(target.parent)
    finally:
        partial.unlink(missing_ok=True)


def resolve_weights(path: Path) -> Path:
    """Return the weights that a path or a name stands for: a file or folder there is, else a model of the cache.

    A name is that of data/models.toml (`yolox_nano`), the file's, or the file's without its ending; or a hub id
    (`organisation/model`) of which the hub's own cache holds the folder. Raises MissingDependency when there is none,
    BadInput when several have the name or the cached file is damaged.
    """
    path = Path(path)
    if os.path.isfile(path) or os.path.isdir(path):
        return path
    name = str(path)
    cached = cached_models()
    matching = [model for model in cached if name in _names(model)]
    if not matching:
        if is_hub_id(name):
            return find_in_hub_cache(name)
        listed = next((model for model in known_models() if path.name in (model.name, model.file)), None)
        if listed is not None:
            hint = f"get {listed.file} from {listed.source}, then: scenewright models --add {listed.file}"
            raise MissingDependency(f"{name}: not in the cache {cache_folder()}", hint=hint)
        raise MissingDependency(f"{path}: no such weight file", hint="see: scenewright models")
    if len(matching) > 1:
        paths = ", ".join(str(model.path) for model in matching)
        raise BadInput(f"{name}: {len(matching)} cached models have this name", hint=f"give one of: {paths}")
    if sha256_of_file(matching[0].path)[:PREFIX_LENGTH] != matching[0].prefix:
        raise BadInput(f"{matching[0].path}: damaged, its sha256 is another one", hint="delete it and add it again")
    return matching[0].path


def with_usual_models(reads: Mapping[str, object], parameters: object, given: Mapping[str, Path]) -> dict[str, Path]:
    """Return the inputs (role -> path) with those models of the cache that the step takes when nothing was given.

    Raises BadInput as `resolve_weights` does.
    """
    complete = dict(given)
    for role, declared in reads.items():
        if role in complete or not isinstance(declared, Optionally) or declared.usual is None:
            continue
        name = declared.usual(parameters, complete)
        if name and any(name in _names(model) for model in cached_models()):
            complete[role] = resolve_weights(Path(name))
            logger.info("--%s: %s, from the cache of models", role.replace("_", "-"), name)
    return complete


def _names(model: CachedModel) -> set[str]:
    return {model.name, Path(model.name).stem, *((model.known.name,) if model.known else ())}
