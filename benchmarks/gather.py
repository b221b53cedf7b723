"""One table and one metrics.json of a target's parts, as far as they have run.

    python -m benchmarks.gather TARGET --out FOLDER

Parts are folders below FOLDER, each with metrics.json and table.md.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from schemas.errors import BadInput

PARTS = {
    "planning": ("motion", "tamp"),
    "tidy": ("fast", "seen", "physics", "pulls", "holds", "detect", "detect_real"),
    "stitch": ("needle", "segmentation", "thread", "trials", "chain"),
}
"""Of each make target."""


def gather(target: str, folder: Path) -> tuple[dict[str, float], str]:
    """Return the figures and the tables of a target's parts. Raises BadInput when there is none, or two differ on a
    figure."""
    figures: dict[str, float] = {}
    texts = []
    for part in PARTS[target]:
        path = folder / part / "metrics.json"
        if not path.is_file():
            continue
        for name, value in json.loads(path.read_text(encoding="utf-8")).items():
            if figures.setdefault(name, value) != value:
                raise BadInput(f"{path}: {name} is {value} here and {figures[name]} in another part")
        texts.append((folder / part / "table.md").read_text(encoding="utf-8").rstrip())
    if not texts:
        raise BadInput(f"{folder}: no part of `make {target}` has run", hint=f"parts are {', '.join(PARTS[target])}")
    return figures, "\n\n".join(texts) + "\n"


def main() -> None:
    """Parse the command line and write."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.gather", description=__doc__)
    parser.add_argument("target", choices=sorted(PARTS))
    parser.add_argument("--out", type=Path, required=True)
    options = parser.parse_args()
    folder = options.out
    figures, text = gather(options.target, folder)
    (folder / "metrics.json").write_text(json.dumps(figures, indent=1, sort_keys=True) + "\n")
    (folder / "table.md").write_text(text, encoding="utf-8")
    print(folder / "table.md")


if __name__ == "__main__":
    main()
