"""`python -m benchmarks.board.publishing`: docs/results/board.json out of the records, and the plot over versions.

Nothing is measured here and nothing can be told by hand: whoever runs it gets the file that is published.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from scenewright.schemas.errors import BadInput, ScenewrightError

from benchmarks.board.figures import (
    Version,
    line_for_a_lab,
    logs_figures,
    others_figures,
    rooms_figures,
    versions_figures,
)
from benchmarks.board.inputs import BOARD, GENERATOR
from benchmarks.board.looks import LOOKS, Look, read_looks
from benchmarks.board.records import RECORDS, Line, by_case, read_lines
from benchmarks.board.rooms import PUBLIC_PART, REFERENCE, REFERENCE_COMMIT, SEALED_PART
from benchmarks.tabulation import Figure

PUBLISHED = RECORDS.parent / "board.json"
PLOT = RECORDS.parents[1] / "images" / "board.svg"
MACHINE = "two cores"
ABOUT = {
    "simulated": "rooms, walks, pictures and noisy depth; masks are the true ones with lasting errors at a detector's "
    "rates on real frames; in `everything` depth bends, poses are estimated, the library lacks the rooms' styles and "
    "sizes are wrong by up to a fifth. Real logs are recorded",
    "knows": "Frames, masks, a library",
    "does_not_show": (
        "A detector's own masks in a room that people live in: errors of the masks have the rates of real "
        "ones, not their shapes. Long walks and large pictures: a room has forty frames of 320 x 240. Public "
        "rooms have been seen; sealed ones follow the same six recipes."
    ),
}
SHOWN_OVER_VERSIONS = {
    "pq": "panoptic quality",
    "support_f1": "F1 of supports",
    "functional": "functionally equivalent",
    "at_rest_of_true": "at rest, of the true",
    "found_large": "large things found",
}


def read_versions(folder: Path = RECORDS / "records") -> list[Version]:
    """Return the records of every method that was measured, the oldest commit first. Raises BadInput for a file that no
    program wrote, and for lines of a checkout that was not as committed."""
    versions = []
    for records in sorted(path for path in folder.glob("*") if path.is_dir()):
        lines = [line for file in sorted(records.glob("*.jsonl")) for line in read_lines(file)]
        for line in lines:
            commit = REFERENCE_COMMIT if line.trial.arm == REFERENCE else records.name
            if not line.clean or not line.commit.startswith(commit):
                raise BadInput(f"{records}: {line.trial} is not of that commit", hint="measure it anew: make board")
        if lines:
            versions.append(Version(records.name, lines))
    return sorted(versions, key=lambda version: (version.lines[0].committed, version.commit))


def published(versions: Sequence[Version], looks: Sequence[Look]) -> dict[str, Any]:
    """Return what docs/results/board.json holds, of the newest version of each part and of all. Raises BadInput without
    any."""
    if not versions:
        raise BadInput("nothing is measured yet", hint="make board")
    newest = versions[-1]
    commits = newest_of_parts(versions)
    lines = [line for version in versions for line in version.lines if commits[line.trial.part] == version.commit]
    figures = rooms_figures(lines) | others_figures(lines) | logs_figures(lines) | versions_figures(versions)
    judges = sorted({(line.trial.part, line.judge) for version in versions for line in version.lines})
    methods = ", ".join(f"{part} {commit}" for part, commit in sorted(commits.items()))
    return {
        "experiment": "board",
        "title": "The board: figures that versions can be compared by",
        "date": max(line.day for line in lines),
        "days": {part: max(line.day for line in lines if line.trial.part == part) for part in sorted(commits)},
        "commit": newest.commit,
        "machine": MACHINE,
        "command": "make board",
        **ABOUT,
        "notes": f"Board {BOARD}: rooms by the generator of {GENERATOR}. Looks at sealed rooms: {len(looks)}, of "
        f"{len({look.digest for look in looks})} methods. Commits that are shown: {methods}. "
        "Judges, whose figures compare where they are the same: "
        f"{', '.join(f'{part} {judge}' for part, judge in judges)}.",
        "figures": {name: asdict(figure) for name, figure in sorted(figures.items())},
        "rows": {"looks": looks_rows(looks), "lines": lab_rows(lines)},
    }


def newest_of_parts(versions: Sequence[Version]) -> dict[str, str]:
    """Return part of the board -> commit of the newest version that measured it: a part takes an hour, and the figures
    of one stand until it is measured again."""
    return {line.trial.part: version.commit for version in versions for line in version.lines}


def looks_rows(looks: Sequence[Look]) -> dict[str, Any]:
    """Return the table of who looked at sealed rooms."""
    return {
        "columns": ["day", "method", "commit", "who"],
        "rows": [[look.day, look.digest, look.commit, look.who] for look in looks],
    }


def lab_rows(lines: Sequence[Line]) -> dict[str, Any]:
    """Return a sentence for each condition of the generated rooms, and for each real log."""
    rows = [
        [f"{part} rooms, {case}, {arm}", line_for_a_lab(found)]
        for (part, case, arm), found in sorted(by_case(lines).items())
        if part in (PUBLIC_PART, SEALED_PART)
    ]
    rows += [[f"{line.trial.seed}, {line.trial.case}", line.facts["line"]] for line in lines if "line" in line.facts]
    return {"columns": ["where", "in one line"], "rows": rows}


def text_of(content: Mapping[str, Any]) -> str:
    """Return the file's text."""
    return json.dumps(content, indent=1, sort_keys=True) + "\n"


def draw(figures: Mapping[str, Figure], versions: Sequence[Version], file: Path) -> None:
    """Draw the headline of the public rooms over versions."""
    import matplotlib as mpl

    mpl.use("svg")
    mpl.rcParams["svg.hashsalt"] = "board"
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(figsize=(7, 3.2), layout="constrained")
    names = [version.commit for version in versions]
    for measure, words in SHOWN_OVER_VERSIONS.items():
        found = [figures.get(f"{name}/versions/public/everything/{measure}") for name in names]
        known = [(place, one) for place, one in enumerate(found) if one is not None]
        if known:
            places, values = [place for place, _ in known], [one.value for _, one in known]
            reach = [
                [one.value - (one.low or one.value) for _, one in known],
                [(one.high or one.value) - one.value for _, one in known],
            ]
            axes.errorbar(places, values, reach, marker="o", capsize=3, label=words)
    axes.set_xticks(range(len(names)), names)
    axes.set_ylim(0, 1)
    axes.set_ylabel("mean over public rooms")
    axes.legend(fontsize="small", ncols=2)
    figure.savefig(file, metadata={"Date": None})
    plt.close(figure)


def main(argv: Sequence[str] | None = None) -> int:
    """Write the file, or compare it; return the exit code."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.board.publishing", description=__doc__)
    parser.add_argument("--check", action="store_true", help="change nothing; fail where the file says another thing")
    asked = parser.parse_args(argv)
    try:
        versions = read_versions()
        content = published(versions, read_looks(LOOKS))
    except ScenewrightError as error:
        print(f"error: {error}", file=sys.stderr)
        return error.exit_code
    if asked.check:
        return 0 if PUBLISHED.is_file() and PUBLISHED.read_text(encoding="utf-8") == text_of(content) else 4
    PUBLISHED.write_text(text_of(content), encoding="utf-8")
    draw(versions_figures(versions), versions, PLOT)
    print(f"{PUBLISHED}: `make figures` shows it", file=sys.stderr)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
