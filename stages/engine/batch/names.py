"""Names of scenes: unique, safe as folder names, and made from paths so that people recognise them."""

from __future__ import annotations

import glob
import hashlib
import re
from collections.abc import Sequence
from pathlib import Path, PurePath

RESERVED = frozenset({"results.jsonl", "summary.csv", "summary.md", "summary.html", "slurm"})
"""What the batch itself writes into its folder."""
_LONGEST = 100
"""Longest name of a folder [bytes]; longer ones are cut and end in a digest."""
_UNSAFE = re.compile(r"[^\w.+-]+")


def is_folder_name(name: str) -> bool:
    """Tell whether a given name can be a folder of the batch as it is."""
    return (
        bool(name)
        and not name.startswith((".", "-"))
        and "/" not in name
        and all(ord(letter) >= 32 for letter in name)
        and len(name.encode()) <= 200
        and name.casefold() not in RESERVED
    )


def as_folder_name(text: str) -> str:
    """Turn any text into a safe folder name: blanks and marks become `_`, long ones are cut and get a digest."""
    name = _UNSAFE.sub("_", text).lstrip(".-") or "scene"
    if len(name.encode()) > _LONGEST:
        name = name.encode()[: _LONGEST - 9].decode(errors="ignore") + "-" + _digest(text)
    return f"{name}_" if name.casefold() in RESERVED else name


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()[:8]


def matched_part(path: PurePath, pattern: str) -> str:
    """Return what the wildcards of `pattern` stand for in `path`: `/data/*/log.mcap` gives `kitchen`.

    Literal components before the first and after the last wildcard are left out, and so is a suffix that the pattern
    spells out. The name of a scene then does not depend on what else the pattern finds.
    """
    components = PurePath(pattern).parts
    magic = [k for k, component in enumerate(components) if glob.has_magic(component)]
    if not magic:
        return path.stem
    after = len(components) - 1 - magic[-1]
    matched = list(path.parts[magic[0] : len(path.parts) - after])
    suffix = PurePath(components[-1]).suffix
    if matched and not after and suffix and not glob.has_magic(suffix):
        matched[-1] = matched[-1].removesuffix(suffix)
    return "-".join(matched) or path.stem


def names_from_paths(paths: Sequence[Path]) -> list[str]:
    """Name paths after their last part; where several share it, the folders above are put before it.

    A file is named without its suffix. Paths are absolute and differ, hence the names differ in the end.
    """
    name_chains = [(*path.parts[1:-1], path.stem if path.is_file() else path.name) for path in paths]
    return distinct([["-".join(p[-count:]) for count in range(1, len(p) + 1)] for p in name_chains])


def distinct(candidates: Sequence[Sequence[str]]) -> list[str]:
    """Choose for each item the first of its candidates (short to long) that makes the names differ.

    Names that differ in case alone count as equal, as some file systems cannot tell them apart. What stays equal gets
    a digest of its longest candidate and its number.
    """
    depth = [0] * len(candidates)
    while True:
        names = [as_folder_name(options[level]) for options, level in zip(candidates, depth, strict=True)]
        owners: dict[str, list[int]] = {}
        for k, name in enumerate(names):
            owners.setdefault(name.casefold(), []).append(k)
        clashing = [k for group in owners.values() if len(group) > 1 for k in group]
        deeper = [k for k in clashing if depth[k] + 1 < len(candidates[k])]
        if not deeper:
            for k in clashing:
                names[k] = f"{names[k]}-{_digest(f'{candidates[k][-1]}/{k}')}"
            return names
        for k in deeper:
            depth[k] += 1
