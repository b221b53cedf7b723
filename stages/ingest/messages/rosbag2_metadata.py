"""What `metadata.yaml` of a rosbag2 folder says that reading needs; nothing in it leads out of the folder."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Any

from ruamel.yaml import YAML
from ruamel.yaml.error import YAMLError
from ruamel.yaml.events import (
    AliasEvent,
    MappingEndEvent,
    MappingStartEvent,
    ScalarEvent,
    SequenceEndEvent,
    SequenceStartEvent,
)
from scenewright.schemas.errors import BadInput
from scenewright.schemas.outside import file_text

NAME = "metadata.yaml"
KEY = "rosbag2_bagfile_information"
LARGEST = 2 << 20
"""Most bytes of a metadata.yaml; a bag of 1,000 parts has about a tenth of it."""
DEEPEST = 20
"""Maps and lists within each other that are accepted."""
PART_SUFFIXES = (".db3", ".mcap")
PACKED_SUFFIXES = (".zstd", ".zst")


@dataclass(frozen=True)
class BagMetadata:
    """The layout of a bag."""

    parts: tuple[Path, ...]
    """In the order in which they were recorded; they may be missing."""
    packed_messages: bool = False
    """Whether every message is packed with zstd on its own."""
    message_count: int | None = None


def read_bag_metadata(folder: Path) -> BagMetadata:
    """Return what metadata.yaml says. Raises BadInput when it is missing, damaged, or leads out of the folder."""
    path = folder / NAME
    try:
        tree = _tree(file_text(path, LARGEST))
        if not isinstance(tree, dict) or not isinstance(tree.get(KEY), dict):
            raise ValueError("it does not describe a bag")
        return _metadata_of(folder, tree[KEY])
    except BadInput:
        raise
    except (OSError, ValueError, YAMLError) as error:
        reason = " ".join(str(error).split())
        raise BadInput(f"{path}: cannot be read: {reason:.200}", hint="`ros2 bag reindex` writes it anew") from None


def _tree(text: str) -> Any:
    """Return the maps, lists and texts of a YAML document.

    Built from the parser's events and not by its constructors, so that there are no aliases, merges, tags and depths
    that multiply what stands in the file. Raises ValueError, YAMLError.
    """
    top: list[Any] = []
    open_nodes: list[tuple[list[Any] | dict[str, Any], list[str]]] = [(top, [])]
    """Every open list or map, the key that a map waits for a value of."""
    for event in YAML(typ="safe", pure=True).parse(text):
        node: Any
        if isinstance(event, AliasEvent):
            raise ValueError("it holds aliases, which no recorder writes")
        if isinstance(event, SequenceEndEvent | MappingEndEvent):
            open_nodes.pop()
            continue
        if isinstance(event, ScalarEvent):
            node = event.value
        elif isinstance(event, SequenceStartEvent | MappingStartEvent):
            node = [] if isinstance(event, SequenceStartEvent) else {}
        else:
            continue
        parent, key = open_nodes[-1]
        if isinstance(parent, list):
            parent.append(node)
        elif key:
            parent[key.pop()] = node
        elif isinstance(node, str):
            key.append(node)
        else:
            raise ValueError("it has a key that is not text")
        if not isinstance(node, str):
            open_nodes.append((node, []))
        if len(open_nodes) > DEEPEST:
            raise ValueError(f"it is nested more than {DEEPEST} deep")
    return top[0] if top else None


def _metadata_of(folder: Path, information: dict[str, Any]) -> BagMetadata:
    mode, packing = str(information.get("compression_mode", "")).lower(), information.get("compression_format", "")
    if mode not in ("", "none") and packing != "zstd":
        raise ValueError(f"messages are packed with {packing!r:.40}, only zstd is read")
    names = information.get("relative_file_paths")
    if not isinstance(names, list) or not all(isinstance(name, str) and name for name in names):
        raise ValueError("relative_file_paths is not a list of names")
    parts = tuple(dict.fromkeys(_inside(folder, name) for name in names))
    count = str(information.get("message_count"))
    return BagMetadata(parts, mode == "message", int(count) if count.isdecimal() else None)


def _inside(folder: Path, name: str) -> Path:
    """Return the path of a part. Bags before version 4 name the folder too. Raises BadInput for one outside."""
    path = folder / name
    if not path.exists() and len(PurePosixPath(name).parts) == 2 and ".." not in PurePosixPath(name).parts:
        path = folder / PurePosixPath(name).name
    if not path.resolve().is_relative_to(folder.resolve()):
        raise BadInput(f"{folder / NAME}: names the part {name!r:.100}, which is outside of the folder")
    return path


def listed_parts(folder: Path) -> tuple[Path, ...]:
    """Return the files of a folder that have the suffix of a part of a bag, numbers in their names in order."""
    return tuple(sorted((path for path in folder.iterdir() if is_part_name(path.name)), key=_natural))


def is_part_name(name: str) -> bool:
    """Whether a file is called like a part of a bag."""
    for suffix in PACKED_SUFFIXES:
        name = name.removesuffix(suffix)
    return name.endswith(PART_SUFFIXES)


def _natural(path: Path) -> list[tuple[int, str]]:
    return [(int(piece), "") if piece.isdecimal() else (-1, piece) for piece in re.split(r"([0-9]+)", path.name)]
