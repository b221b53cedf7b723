"""`python -m benchmarks.figures [--check]`."""

from __future__ import annotations

import argparse
import sys
import tomllib
from collections.abc import Sequence

from benchmarks.figures.content import FiguresError, load_experiments
from benchmarks.figures.pages import ROOT, homes, pages, render


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description="Render the figures of README.md and docs/ from docs/results/*.json.")
    parser.add_argument("--check", action="store_true", help="change nothing; fail where a page shows another figure")
    options = parser.parse_args(arguments)
    experiments = load_experiments(ROOT / "docs" / "results")
    stale = []
    for page in pages(ROOT):
        text = page.read_text()
        try:
            made = render(text, experiments, homes(ROOT, page))
        except (FiguresError, tomllib.TOMLDecodeError) as error:
            print(f"{page.relative_to(ROOT)}: {error}", file=sys.stderr)
            return 3
        if made != text:
            stale.append(str(page.relative_to(ROOT)))
            if not options.check:
                page.write_text(made)
    if stale:
        print(f"{'shows other figures' if options.check else 'written'}: {', '.join(stale)}", file=sys.stderr)
    return 4 if options.check and stale else 0


if __name__ == "__main__":
    sys.exit(main())
