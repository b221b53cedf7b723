"""What the metadata of a network's file says: Python's literals or JSON, as the exporters of YOLO write them."""

from __future__ import annotations

import ast
import json
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from scenewright.schemas.errors import BadInput
from scenewright.schemas.outside import opened
from scenewright.stages.kit.formats.zip_files import find_entry, zip_errors

LONGEST = 100_000
"""Longest value [characters, bytes]."""
MOST_TEXTS = 10
"""Entries of an archive that are looked at."""


def literal(text: str) -> Any:
    """Return the value that a text writes as JSON or as Python does; None: it is none, or too long."""
    if not text or len(text) > LONGEST:
        return None
    for read in (json.loads, ast.literal_eval):
        try:
            return read(text)
        except (ValueError, SyntaxError, RecursionError, MemoryError):
            continue
    return None


def class_names(listed: Any) -> dict[int, str]:
    """Return number -> name of a list of names or of a table of numbers and names; empty: it is neither."""
    if isinstance(listed, list | tuple):
        listed = dict(enumerate(listed))
    if not isinstance(listed, dict):
        return {}
    rows = {int(k) if isinstance(k, str) and k.isdecimal() and len(k) < 6 else k: v for k, v in listed.items()}
    return {k: v for k, v in rows.items() if isinstance(k, int) and isinstance(v, str)}


def picture_size(told: Any) -> tuple[int, int] | None:
    """Return width and height [pixels] of `imgsz`, which has the height first; None: it says none."""
    if isinstance(told, list | tuple) and len(told) == 2 and all(type(n) is int and 0 < n <= 16384 for n in told):
        return (told[1], told[0])
    return None


def appended(path: Path) -> Mapping[str, Any]:
    """Return what is written in the archive that may hang on a .tflite file: keys and values, and `names` of a label
    file (one name a line). Empty where there is none that can be read."""
    found: dict[str, Any] = {}
    try:
        with opened(path) as file, zip_errors(path, ""), zipfile.ZipFile(file) as archive:
            for name in archive.namelist()[:MOST_TEXTS]:
                text = archive.read(find_entry(archive, name, LONGEST)).decode("utf-8", errors="replace")
                value = literal(text)
                if isinstance(value, dict):
                    found.update({k: v for k, v in value.items() if isinstance(k, str)})
                elif name.endswith(".txt"):
                    found.setdefault("names", [line.strip() for line in text.splitlines()])
    except BadInput:  # a file without an archive is a network like any other
        return found
    return found
