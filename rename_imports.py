"""Rewrites `stages`, `schemas` and `cli` to `scenewright.stages` and so on: `python rename_imports.py`.

Works on names that exist in the tree, in code, in texts of code and in documents. Goes when every branch has run it.
"""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

ROOT = Path(__file__).resolve().parent
TOPS = ("stages", "schemas", "cli")
PATTERN = re.compile(r"(?<![\w./\-])(stages|schemas|cli)\.([a-z_]\w*|\{)")
STATEMENT = re.compile(r"(?<![\w.])(from|import) (stages|schemas|cli)(?= import|$|\s*[\n,;]| as )", re.M)


def exists(top: str, name: str) -> bool:
    """Whether the tree has a module or package of that name, or the text is to be filled in."""
    return name == "{" or (ROOT / top / name).is_dir() or (ROOT / top / f"{name}.py").is_file()


def rewritten(text: str) -> str:
    """Return the text with every dotted name of ours below scenewright."""

    def dotted(match: re.Match[str]) -> str:
        top, name = match.groups()
        return f"scenewright.{match.group(0)}" if exists(top, name) else match.group(0)

    text = PATTERN.sub(dotted, text)
    text = STATEMENT.sub(r"\1 scenewright.\2", text)
    text = re.sub(r"-m cli\b", "-m scenewright", text)
    return text.replace('"-m", "cli"', '"-m", "scenewright"')


def main() -> None:
    """Rewrite all tracked texts but figures and generated results."""
    listed = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=True).stdout.split(
        "\n"
    )
    for name in listed:
        path = ROOT / name
        if (
            path.suffix not in (".py", ".md", ".toml", ".mk", ".ipynb", ".yml", ".html", ".sh", "")
            or "results/" in name
        ):
            continue
        if not path.is_file() or path == Path(__file__):
            continue
        try:
            before = path.read_text(encoding="utf-8")
        except UnicodeDecodeError:
            continue
        if (after := rewritten(before)) != before:
            path.write_text(after, encoding="utf-8")


if __name__ == "__main__":
    main()
