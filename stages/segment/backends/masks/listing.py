"""The files of a folder of masks, and its JSON: bounded, and read once."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NoReturn

from scenewright.schemas.errors import BadInput
from scenewright.schemas.outside import file_content

LARGEST_JSON = 512 * 2**20
"""Most bytes of a JSON file."""
MOST_FILES = 200_000
"""Most files of a folder of masks; a guard, by eye."""
CLASS_FILES = ("classes.json", "classes.txt", "class_names.txt", "_classes.csv")
"""Files that say which number is which class; no masks. The last two are labelme2voc's and Roboflow's."""
HINT = "docs/MASKS.md lists what is read"


class Listing:
    """The files of a folder (hidden ones left out), or one file. Raises BadInput when there is none.

    `numbered`, number -> name, says what numbers mean where no class file does: the table of `--labels`.
    """

    def __init__(self, root: Path, numbered: Mapping[int, str] | None = None) -> None:
        self.root = Path(root)
        self.numbered = dict(numbered or {})
        self.files: list[Path] = [self.root] if self.root.is_file() else []
        for file in self.root.rglob("*") if self.root.is_dir() else ():
            if file.is_file() and not any(part.startswith(".") for part in file.relative_to(self.root).parts):
                self.files.append(file)
            if len(self.files) > MOST_FILES:
                raise BadInput(f"{self.root}: more than {MOST_FILES} files", hint="give the folder of the masks alone")
        self.files.sort(key=lambda file: file.as_posix())
        if not self.files:
            raise BadInput(f"{self.root}: holds no files", hint=HINT)
        self._json: dict[Path, Any] = {}

    def ending(self, suffix: str) -> list[Path]:
        """Return the files that end like this (`.png`), sorted; class files are none of them."""
        return [file for file in self.files if file.suffix.lower() == suffix and file.name not in CLASS_FILES]

    def class_file(self) -> Path | None:
        """Return the class file of the folder, if there is one."""
        return self.named(*CLASS_FILES)

    def named(self, *names: str) -> Path | None:
        """Return the first file of one of these names, if there is one."""
        return next((file for name in names for file in self.files if file.name == name), None)

    def class_source(self) -> str:
        """Return, for messages, what says which number is which class."""
        path = self.class_file()
        return path.name if path else "--labels"

    def json(self, path: Path) -> Any:
        """Return what a JSON file holds; it is kept."""
        if path not in self._json:
            self._json[path] = read_json(path)
        return self._json[path]


def read_json(path: Path) -> Any:
    """Return what a JSON file holds. Raises BadInput when it is none, holds NaN, or is too large or too deep."""
    try:
        if path.stat().st_size > LARGEST_JSON:
            raise BadInput(f"{path}: larger than {LARGEST_JSON} bytes", hint="write one file a frame")
        return json.loads(
            file_content(path, LARGEST_JSON, hint="check the file").decode("utf-8"), parse_constant=_no_constant
        )
    except OSError as error:
        raise BadInput(f"{path}: {error.strerror or error}", hint="check the file") from None
    except (ValueError, RecursionError) as error:
        raise BadInput(f"{path}: no JSON ({str(error).splitlines()[0]:.80})", hint="write it again") from None


def _no_constant(name: str) -> NoReturn:
    raise ValueError(f"{name} is not a number of JSON")
