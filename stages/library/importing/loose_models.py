"""Models that are one mesh file, and the ShapeNetSem layout around such (metadata.csv, models/<id>.obj)."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from scenewright.schemas.errors import BadInput
from scenewright.schemas.outside import opened
from scenewright.stages.kit.geometry.file_axes import Direction
from scenewright.stages.library.importing.mesh_reading import read_mesh_file
from scenewright.stages.library.importing.source_folder import SourceFolder, numbers
from scenewright.stages.library.importing.source_model import Declared, SourceLink, SourceModel

LARGEST_TABLE = 64 * 2**20
"""Largest metadata.csv [bytes]; a bound, by eye."""
LARGEST_HEADER = 64 * 2**10
"""Bytes of a table that are read to find its header; by eye."""
SHAPENET_COLUMNS = {"fullId", "category", "up", "front", "unit"}
SHAPENET_READ = SHAPENET_COLUMNS | {"name", "isContainerLike"}
SHAPENET_UP: Direction = (0.0, 0.0, 1.0)
"""Up direction of ShapeNetSem where a cell is empty (its README)."""
SHAPENET_FRONT: Direction = (0.0, -1.0, 0.0)
"""What an empty cell of metadata.csv means (ShapeNetSem's README)."""
BODY = "body"


def read_loose_model(folder: SourceFolder, path: Path) -> SourceModel:
    """Return a single mesh file as a rigid model. Raises BadInput."""
    content = read_mesh_file(folder, path)
    words = [path.stem]
    if path.parent != folder.root:
        words.append(path.parent.name)
    return SourceModel(
        name=path.stem,
        source=folder.relative(path),
        format=path.suffix[1:].upper(),
        links=(SourceLink(BODY, content.surfaces),),
        unit=content.unit,
        up=content.up,
        words=tuple(words),
        findings=content.findings,
    )


def is_shapenet_table(folder: SourceFolder, path: Path) -> bool:
    """Whether a metadata.csv has ShapeNetSem's columns."""
    try:
        with opened(path) as file:
            head = file.read(LARGEST_HEADER)
        return set(next(_table(head), [])) >= SHAPENET_COLUMNS
    except (BadInput, OSError, csv.Error):
        return False


def _table(data: bytes) -> Iterator[list[str]]:
    """Return the rows of a CSV file, whatever ends its lines."""
    text = io.TextIOWrapper(io.BytesIO(data), encoding="utf-8", errors="replace")
    return csv.reader(line.lstrip("\ufeff") if number == 0 else line for number, line in enumerate(text))


def shapenet_rows(folder: SourceFolder, table: Path) -> list[tuple[Path, dict[str, str]]]:
    """Return (mesh file, row) of every row whose mesh is there, in the table's order; of rows of one mesh the first.

    Raises BadInput.
    """
    rows = []
    identities: set[str] = set()
    try:
        lines = _table(folder.read(table, LARGEST_TABLE))
        names = next(lines, [])
        for cells in lines:
            row = {key: value for key, value in zip(names, cells, strict=False) if key in SHAPENET_READ}
            identity = row.get("fullId", "").rpartition(".")[2]
            if identity in identities:
                continue
            identities.add(identity)
            for name in (f"models/{identity}.obj", f"models-OBJ/models/{identity}.obj", f"{identity}.obj"):
                path = table.parent / name
                if identity and path.is_file() and (file := folder.find(name, table.parent)) is not None:
                    rows.append((file, row))
                    break
    except csv.Error as error:
        raise BadInput(f"{table}: no table: {error}") from None
    return rows


def read_shapenet_model(folder: SourceFolder, path: Path, row: dict[str, str]) -> SourceModel:
    """Return a ShapeNetSem model with the unit, up and front of its row. Raises BadInput."""
    where = f"{path.stem} of metadata.csv"
    content = read_mesh_file(folder, path)
    categories = [word for word in row.get("category", "").split(",") if word and not word.startswith("_")]
    unit = Declared(None, "assumed")
    if row.get("unit", "").strip():
        metres = float(numbers(row["unit"], 1, f"{where}: unit")[0])
        if not 0 < metres < 1e6:
            raise BadInput(f"{where}: unit of {metres:g} m")
        unit = Declared(metres, "file")
    container = row.get("isContainerLike", "").strip().lower()
    return SourceModel(
        name=path.stem,
        source=folder.relative(path),
        format="ShapeNetSem",
        links=(SourceLink(BODY, content.surfaces),),
        unit=unit,
        up=_direction(row.get("up", ""), SHAPENET_UP, f"{where}: up"),
        front=_direction(row.get("front", ""), SHAPENET_FRONT, f"{where}: front"),
        words=tuple(dict.fromkeys([*categories, row.get("name", "")])),
        contains=True if container in ("1", "1.0", "true") else None,
        findings=content.findings,
    )


def _direction(text: str, empty: Direction, where: str) -> Declared:
    """Return a direction written `0.0\\,0.0\\,1.0`."""
    plain = text.replace("\\", " ").replace(",", " ").strip()
    if not plain:
        return Declared(empty, "format")
    values = numbers(plain, 3, where)
    length = float(np.linalg.norm(values))
    if length < 1e-9:
        raise BadInput(f"{where}: a direction of length 0")
    x, y, z = (float(v) for v in values / length)
    return Declared((x, y, z), "file")
