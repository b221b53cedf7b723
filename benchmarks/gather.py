"""One table and one metrics.json of the experiments that have run below a folder."""

from __future__ import annotations

import json
from pathlib import Path

from scenewright.schemas.errors import BadInput


def gather(folder: Path) -> str:
    """Write metrics.json and table.md of the parts of a folder (its folders with both files, by name); return the
    table. Raises BadInput when there is none, or two differ on a figure of an arm."""
    figures: dict[str, float] = {}
    texts = []
    for path in sorted(folder.glob("*/metrics.json")):
        for name, value in json.loads(path.read_text(encoding="utf-8")).items():
            own = name.startswith("all/") and name.endswith("/trials")
            if not own and figures.setdefault(name, value) != value:
                raise BadInput(f"{path}: {name} is {value} here and {figures[name]} in another part")
        texts.append(f"## {path.parent.name}\n\n" + path.with_name("table.md").read_text(encoding="utf-8").rstrip())
    if not texts:
        raise BadInput(f"{folder}: no part has run")
    (folder / "metrics.json").write_text(json.dumps(figures, indent=1, sort_keys=True) + "\n")
    (folder / "table.md").write_text("\n\n".join(texts) + "\n", encoding="utf-8")
    return "\n\n".join(texts) + "\n"
