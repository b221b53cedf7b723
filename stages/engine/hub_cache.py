"""Model folders in the cache that `hf download` fills: looked up by hub id, never fetched.

`$HF_HUB_CACHE`, else `$HF_HOME/hub`, else `~/.cache/huggingface/hub`.
"""

from __future__ import annotations

import os
import re
from pathlib import Path

from scenewright.schemas.errors import BadInput, MachineFailure, MissingDependency
from scenewright.schemas.outside import file_text

HUB_ID = re.compile(
    r"(?P<model>[A-Za-z0-9][\w.-]{0,95}/[A-Za-z0-9][\w.-]{0,95})(@(?P<revision>\w[\w.-]*(/\w[\w.-]*)*))?", re.ASCII
)
"""`organisation/model`, or `organisation/model@revision` (a branch, tag, commit or `refs/pr/N`)."""
LONGEST_REFERENCE = 4096
"""Bytes of a file that names a commit."""
FILE_ENDINGS = frozenset({".onnx", ".safetensors", ".pt", ".pth", ".bin", ".toml", ".txt", ".json"})


def home_folder() -> Path:
    """Return the home folder. Raises MachineFailure where there is none."""
    try:
        return Path.home()
    except RuntimeError:
        raise MachineFailure("no home folder is known", hint="set HOME") from None


def hub_folder() -> Path:
    """Return the cache; it need not exist."""
    cache = os.environ.get("HF_HUB_CACHE")
    if cache:
        return Path(cache)
    home = os.environ.get("HF_HOME")
    return (Path(home) if home else home_folder() / ".cache" / "huggingface") / "hub"


def is_hub_id(name: str) -> bool:
    """Whether a name reads like the id of a model on the hub and not like a file."""
    return HUB_ID.fullmatch(name) is not None and Path(name).suffix.lower() not in FILE_ENDINGS


def find_in_hub_cache(name: str) -> Path:
    """Return the folder of a model in the cache. Raises MissingDependency with the command that fetches it."""
    match = HUB_ID.fullmatch(name)
    assert match is not None
    model, revision = match["model"], match["revision"] or "main"
    root = hub_folder() / f"models--{model.replace('/', '--')}"
    try:
        commit = file_text(root / "refs" / revision, LONGEST_REFERENCE).strip()
    except BadInput:
        commit = revision
    folder = root / "snapshots" / commit
    if re.fullmatch(r"[\w.-]+", commit, re.ASCII) and commit not in (".", "..") and folder.is_dir():
        return folder
    revision_option = f" --revision {revision}" if match["revision"] else ""
    raise MissingDependency(
        f"{name}: no such folder, and not in the cache {hub_folder()}",
        hint=f"fetch it with: hf download {model}{revision_option}",
    )
