"""Pages with markers: what stands between two of them is made of the JSON files."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Callable, Mapping
from pathlib import Path

from benchmarks.figures.content import Experiment, FiguresError
from benchmarks.figures.lines import inline
from benchmarks.figures.tables import about, headlines, table, words

ROOT = Path(__file__).parents[2]
BLOCK = re.compile(
    r"(?P<open><!-- (?P<kind>table|rows|about|headlines)(?P<spec>.*?)-->\n)(?P<body>.*?)(?P<close><!-- /(?P=kind) -->)",
    re.DOTALL,
)
INLINE = re.compile(r"(?P<open><!--f (?P<spec>[^>]*?)-->)(?P<body>.*?)(?P<close><!--/f-->)", re.DOTALL)


def pages(root: Path) -> list[Path]:
    return [root / "README.md", *sorted((root / "docs").glob("**/*.md"))]


def homes(root: Path, page: Path) -> dict[str, str]:
    """Return, by experiment, the address of its page as seen from `page`."""
    folder = root / "docs" / "results"
    above = "" if page.parent == folder else "results/" if page.parent == root / "docs" else "docs/results/"
    found = {}
    for home in sorted(folder.glob("*.md")):
        for name in re.findall(r"<!-- about (\w+) -->", home.read_text()):
            found[name] = f"{above}{home.name}"
    return found


def render(text: str, experiments: Mapping[str, Experiment], addresses: Mapping[str, str]) -> str:
    """Return the page with everything between markers made anew."""
    own = set(re.findall(r"<!-- about (\w+) -->", text))

    def block(match: re.Match[str]) -> str:
        kind, spec = match["kind"], match["spec"].strip()
        name, _, rest = spec.partition("\n") if kind == "table" else spec.partition(" ")
        name = name.strip()
        if kind != "headlines" and name not in experiments:
            raise FiguresError(f"no docs/results/{name}.json")
        made: dict[str, Callable[[], str]] = {
            "table": lambda: table(experiments[name], tomllib.loads(rest), name in own),
            "rows": lambda: words(experiments[name], rest.strip(), name in own),
            "about": lambda: about(experiments[name]),
            "headlines": lambda: headlines(experiments, tomllib.loads(spec), addresses),
        }
        return match["open"] + made[kind]() + match["close"]

    text = BLOCK.sub(block, text)
    return INLINE.sub(lambda match: match["open"] + inline(experiments, match["spec"]) + match["close"], text)
