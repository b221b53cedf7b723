"""Which models a folder holds: descriptions and tables first, then the meshes that none of them names."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

from scenewright.schemas.errors import BadInput
from scenewright.stages.library.importing.limits import told_refusals
from scenewright.stages.library.importing.loose_models import (
    is_shapenet_table,
    read_loose_model,
    read_shapenet_model,
    shapenet_rows,
)
from scenewright.stages.library.importing.mesh_reading import MESH_SUFFIXES
from scenewright.stages.library.importing.mjcf_models import is_mjcf, read_mjcf_models
from scenewright.stages.library.importing.other_formats import other_formats
from scenewright.stages.library.importing.parts_of_others import lone_parts, older_versions, parts_of_others
from scenewright.stages.library.importing.sdf_models import read_sdf_models
from scenewright.stages.library.importing.source_folder import SourceFolder
from scenewright.stages.library.importing.source_model import SourceModel
from scenewright.stages.library.importing.urdf_models import read_partnet_model, read_urdf_model

DESCRIPTIONS = (".urdf", ".sdf", ".world", ".xml", ".mjcf")
PARTNET_FILE, SHAPENET_FILE = "mobility.urdf", "metadata.csv"
SHELVES = {"meshes", "mesh", "visual", "collision", "textured_objs", "materials", "textures"}
"""Folders that hold parts of models."""
PART_OF_A_MODEL = re.compile(r"collision|vhacd|coacd|convex", re.IGNORECASE)
MOST_MODELS = 20_000
"""Most models of a folder; a bound, by eye."""


@dataclass(frozen=True)
class Unread:
    """A file that should hold a model, and why it was not read."""

    source: str
    reason: str


def find_models(folder: SourceFolder) -> Iterator[SourceModel | Unread]:
    """Yield the models of a folder in the order of their paths, descriptions before loose meshes.

    What cannot be read is yielded as Unread. Raises BadInput when there are too many files or models.
    """
    files = folder.files()
    count = 0
    claimed = _Claimed()
    named = [path for path in files if _is_text(path)]
    parts = parts_of_others(folder, named) | older_versions(folder, named)
    for path in files:
        if parts and path.resolve() in parts:
            continue
        if not _is_text(path):
            if path.suffix.lower() in (*MESH_SUFFIXES, *DESCRIPTIONS):
                yield Unread(folder.relative(path), "its name is not UTF-8 (rename it)")
            continue
        for model in _read_claimed(folder, path, claimed):
            count += 1
            if count > MOST_MODELS:
                raise BadInput(f"{folder.root}: more than {MOST_MODELS} models", hint="import its parts one by one")
            yield model
    used = {path.resolve() for path in claimed.files} | set(folder.read_bytes_of)
    for path in files:
        if not _is_text(path) or not claimed.folders.isdisjoint(path.parents):
            continue
        shelves = {part.lower() for part in path.relative_to(folder.root).parts[:-1]}
        if path.suffix.lower() not in MESH_SUFFIXES or path.resolve() in used or shelves & SHELVES:
            continue
        if PART_OF_A_MODEL.search(path.stem):
            continue
        count += 1
        if count > MOST_MODELS:
            raise BadInput(f"{folder.root}: more than {MOST_MODELS} models", hint="import its parts one by one")
        yield _try_to_read(folder, path, partial(read_loose_model, folder, path))
    if count == 0:
        for path in lone_parts(folder, files):
            reason = "a part of an MJCF that no file here includes (add the file that includes it)"
            yield Unread(folder.relative(path), reason)
    for source, reason in other_formats(folder, files):
        yield Unread(source, reason)


@dataclass(frozen=True)
class _Claimed:
    """What belongs to a description."""

    files: set[Path] = field(default_factory=set)
    folders: set[Path] = field(default_factory=set)


def _is_text(path: Path) -> bool:
    try:
        str(path).encode("utf-8")
    except UnicodeEncodeError:
        return False
    return True


def _read_claimed(folder: SourceFolder, path: Path, claimed: _Claimed) -> Iterator[SourceModel | Unread]:
    suffix = path.suffix.lower()
    if path.name == PARTNET_FILE:
        claimed.folders.add(path.parent)
        yield _try_to_read(folder, path, lambda: read_partnet_model(folder, path))
    elif suffix == ".urdf":
        yield _try_to_read(folder, path, lambda: read_urdf_model(folder, path))
    elif suffix in (".sdf", ".world"):
        yield from _several(folder, path, lambda: read_sdf_models(folder, path))
    elif suffix in (".xml", ".mjcf"):
        yield from _several(folder, path, lambda: _models_of_xml(folder, path))
    elif path.name == SHAPENET_FILE and is_shapenet_table(folder, path):
        try:
            with told_refusals(folder.relative(path)):
                rows = shapenet_rows(folder, path)
        except BadInput as error:
            yield Unread(folder.relative(path), str(error))
            return
        claimed.files.update(mesh for mesh, _ in rows)
        for mesh, row in rows:
            yield _try_to_read(folder, mesh, partial(read_shapenet_model, folder, mesh, row))


def _models_of_xml(folder: SourceFolder, path: Path) -> Iterator[SourceModel]:
    """Yield the models of an XML file, whichever description it is; none of one that is another thing.

    Raises BadInput; for a file that is no XML only when it says that it is a model.
    """
    try:
        root = folder.read_xml(path)
    except BadInput:
        if path.suffix.lower() == ".mjcf" or b"<mujoco" in folder.read(path)[:4096]:
            raise
        return
    if is_mjcf(root):
        yield from read_mjcf_models(folder, path)
    elif root.tag == "robot":
        yield read_urdf_model(folder, path)
    elif root.tag == "sdf":
        yield from read_sdf_models(folder, path)


def _try_to_read(folder: SourceFolder, path: Path, read_models: Callable[[], SourceModel]) -> SourceModel | Unread:
    try:
        with told_refusals(folder.relative(path)):
            return read_models()
    except BadInput as error:
        return Unread(folder.relative(path), str(error))


def _several(
    folder: SourceFolder, path: Path, read_models: Callable[[], Iterator[SourceModel]]
) -> Iterator[SourceModel | Unread]:
    models: Iterator[SourceModel] | None = None
    while True:
        try:
            with told_refusals(folder.relative(path)):
                models = read_models() if models is None else models
                model = next(models, None)
        except BadInput as error:
            yield Unread(folder.relative(path), str(error))
            return
        if model is None:
            return
        yield model
