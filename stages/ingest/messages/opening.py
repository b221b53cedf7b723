"""Which container of messages a path is, and opening it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from scenewright.schemas.errors import BadInput
from scenewright.schemas.outside import opened
from scenewright.stages.ingest.messages.container import MessageLog
from scenewright.stages.ingest.messages.mcap_container import open_mcap
from scenewright.stages.ingest.messages.mcap_records import MAGIC as MCAP_MAGIC
from scenewright.stages.ingest.messages.rosbag1_container import open_rosbag1
from scenewright.stages.ingest.messages.rosbag2_container import ZSTD_MAGIC, open_rosbag2
from scenewright.stages.ingest.messages.rosbag2_metadata import KEY, NAME, is_part_name, listed_parts
from scenewright.stages.ingest.messages.sqlite_container import MAGIC as SQLITE_MAGIC

_OPENERS: dict[str, Callable[..., MessageLog]] = {"mcap": open_mcap, "rosbag1": open_rosbag1, "rosbag2": open_rosbag2}
_SUFFIXES = {".mcap": "mcap", ".bag": "rosbag1", ".db3": "rosbag2"}
_ROSBAG1_MAGIC = b"#ROSBAG V"
_METADATA_HEAD = 4096
"""Bytes of a file in which the key of rosbag2's metadata is looked for; by eye."""


def container_of(path: Path) -> str | None:
    """Return `mcap`, `rosbag1` or `rosbag2` by the first bytes of a file, or by what a folder holds; else None."""
    try:
        return _folder_container(path) if path.is_dir() else _file_container(path)
    except OSError:
        return None


def open_message_log(path: Path, *, salvage: bool) -> MessageLog:
    """Open a log of messages. With `salvage`, what is damaged is skipped and stands in its `damage`.

    Raises BadInput when it is no such log; without `salvage` also when anything in it is torn or damaged.
    """
    container = container_of(path)
    if container is None and path.is_file():
        container = _SUFFIXES.get(path.suffix)  # says what is wrong with it
    if container is None:
        if not path.exists():
            raise BadInput(f"{path}: there is no such log", hint="check the path")
        raise BadInput(f"{path}: is neither MCAP nor a ROS bag", hint="docs/LOGS.md describes what is read")
    return _OPENERS[container](path, salvage=salvage)


def _file_container(path: Path) -> str | None:
    if not path.is_file():
        return None
    with opened(path, hint="check its permissions") as file:
        head = file.read(len(SQLITE_MAGIC))
    if head.startswith(MCAP_MAGIC):
        return "mcap"
    if head.startswith(_ROSBAG1_MAGIC):
        return "rosbag1"
    if head.startswith(SQLITE_MAGIC) or (head.startswith(ZSTD_MAGIC) and is_part_name(path.name)):
        return "rosbag2"
    return None


def _folder_container(path: Path) -> str | None:
    metadata = path / NAME
    if metadata.is_file():
        with opened(metadata, hint="check its permissions") as file:
            if KEY.encode() in file.read(_METADATA_HEAD):
                return "rosbag2"
    if any(entry.is_dir() for entry in path.iterdir()):
        return None
    kinds = {_file_container(part) for part in listed_parts(path)}
    return "rosbag2" if kinds & {"mcap", "rosbag2"} else None
