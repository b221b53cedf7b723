"""A library without the styles of a room's models: what a user has, who owns models of other furniture.

Run as a file by the generator's checkout: `python lacking.py --library OTHER --own LIBRARY --truth TRUTH --out FOLDER`.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
from collections.abc import Sequence
from importlib import import_module
from pathlib import Path
from typing import Any

Model = dict[str, Any]


def style_of(model: Model) -> tuple[str, Any]:
    """Return class and style of a model: what its generator calls it, None where it has one style alone."""
    return model["class_name"], model["recipe"].get("style")


def without_styles(library: Sequence[Model], room: Sequence[Model]) -> list[Model]:
    """Return the models of the library in no style that the models of the room have.

    A class stays whole where it has one style, or none that the room lacks: its shapes differ all the same, as the
    library was drawn by another seed.
    """
    taken = {style_of(model) for model in room if style_of(model)[1] is not None}
    left = {model["class_name"] for model in library if style_of(model) not in taken}
    return [model for model in library if style_of(model) not in taken or model["class_name"] not in left]


def write(other: Path, own: Path, truth: Path, out: Path) -> None:
    """Write the library to `out`, with a manifest; models are hard links to those of `other`."""
    used = {thing["model_id"] for thing in json.loads((truth / "ground_truth.json").read_text())["objects"]}
    room = [model for model in json.loads((own / "library.json").read_text())["models"] if model["id"] in used]
    listing = json.loads((other / "library.json").read_text())
    listing["models"] = without_styles(listing["models"], room)
    for model in listing["models"]:
        shutil.copytree(other / "models" / model["id"], out / "models" / model["id"], copy_function=os.link)
    (out / "library.json").write_text(json.dumps(listing, indent=1) + "\n")
    digests, schemas = import_module("stages.engine.digests"), import_module("schemas.manifest")
    records = digests.record_files(out, ())
    base = schemas.Manifest.model_validate_json((other / "manifest.json").read_bytes())
    digest = digests.content_digest(records)
    changed = base.model_copy(update={"files": records, "content_digest": digest, "key": digest})
    (out / "manifest.json").write_text(changed.model_dump_json(indent=1) + "\n")


def main() -> None:
    """Write what the options name."""
    parser = argparse.ArgumentParser(description=__doc__)
    for name in ("library", "own", "truth", "out"):
        parser.add_argument(f"--{name}", type=Path, required=True)
    asked = parser.parse_args()
    write(asked.library, asked.own, asked.truth, asked.out)


if __name__ == "__main__":
    main()
