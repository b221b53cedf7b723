"""What `metadata.yaml` of a rosbag2 folder says that reading needs; nothing in it leads out of the folder."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Any

from ruamel.yaml import YAML
from ruamel.yaml.error import YAMLError

from schemas.errors import BadInput

NAME = "metadata.yaml"
KEY = "rosbag2_bagfile_information"
LARGEST = 2 << 20
"""Bytes of a metadata.yaml that are accepted; a bag of 1,000 parts has about a tenth of it."""
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
        size = path.stat().st_size
        if size > LARGEST:
            raise BadInput(f"{path}: has {size} bytes, more than the {LARGEST} that are accepted")
        text = path.read_text(encoding="utf-8")
        if "<<" in text:  # merged keys multiply; no recorder writes them
            raise ValueError("merges keys (<<)")
        return _described(folder, YAML(typ="safe", pure=True).load(text)[KEY])
    except (OSError, UnicodeDecodeError, YAMLError, ValueError, RecursionError) as error:
        reason = " ".join(str(error).split())
        raise BadInput(f"{path}: cannot be read: {reason:.200}", hint="`ros2 bag reindex` writes it anew") from None
    except (KeyError, TypeError, AttributeError):
        raise BadInput(f"{path}: does not describe a bag", hint="`ros2 bag reindex` writes it anew") from None


def _described(folder: Path, information: Any) -> BagMetadata:
    mode, packing = str(information.get("compression_mode") or "").lower(), information.get("compression_format") or ""
    if mode not in ("", "none") and packing != "zstd":
        raise BadInput(f"{folder}: is packed with {packing!r:.40}, only zstd is read")
    names = information["relative_file_paths"]
    if not isinstance(names, list) or not all(isinstance(name, str) and name for name in names):
        raise BadInput(f"{folder / NAME}: relative_file_paths is no list of names")
    parts = tuple(dict.fromkeys(_inside(folder, name) for name in names))
    count = information.get("message_count")
    return BagMetadata(parts, mode == "message", count if isinstance(count, int) else None)


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
    return [(int(piece), "") if piece.isdigit() else (-1, piece) for piece in re.split(r"([0-9]+)", path.name)]
