"""The commands of suturing in a row, as a user runs them: make stitch, part `chain`.

    python -m benchmarks.stitch.chain --out FOLDER [--quick]

Two scenes, one of separate views and one of a needle that moves, go through `disparity`, `suture needle` (the thesis's
estimator and ours) and `suture thread`; trials of every arm through `suture simulate`; each through `suture evaluate`,
and all of it into one report. Steps that are up to date are not run again. Writes metrics.json and table.md beside the
artifacts; the few views and trials are an example, the parts `needle` and `trials` measure.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from cli.main import run
from stages.suture.options import ARM_NAMES

VIEWS, FRAMES, TRIALS = 12, 10, 25
QUICK_VIEWS, QUICK_FRAMES, QUICK_TRIALS = 2, 2, 3
SEED = 2000
"""Of scenes and trials; no other part of the benchmark uses seeds from here on."""
ACCEPTED = ("abstained", "not_closed", "not_traced", "not_rectified")


def command(*words: str | Path) -> None:
    """Run one command line. Raises SystemExit with its exit code when it fails; an abstention is no failure, and eyes
    that are off by the calibration error that the scene was given are what is to be lived with."""
    accepted = [word for outcome in ACCEPTED for word in ("--accept", outcome)]
    code = run([*map(str, words), *accepted])
    if code != 0:
        raise SystemExit(code)


def see(folder: Path, arrangement: str, frames: int) -> None:
    """Render a scene and run everything that looks at it, below `folder`."""
    scene, disparity = folder / "scene", folder / "disparity"
    words = ("--frames", str(frames), "--arrangement", arrangement, "--seed", str(SEED))
    command("suture", "scene", *words, "--out", scene)
    command("disparity", "--sequence", scene, "--out", disparity)
    seen = ("--sequence", scene)
    command("suture", "needle", *seen, "--disparity", disparity, "--out", folder / "needle")
    thesis = ("--estimator", "thesis", "--pictures", "0")
    command("suture", "needle", *seen, "--disparity", disparity, *thesis, "--out", folder / "needle_thesis")
    command("suture", "thread", *seen, "--needle", folder / "needle", "--out", folder / "thread")
    command(
        "suture", "evaluate", "--scene", scene, "--needle", folder / "needle", "--needle-thesis",
        folder / "needle_thesis", "--thread", folder / "thread", "--out", folder / "evaluation",
    )  # fmt: skip


def main() -> None:
    """Parse the command line and run."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.stitch.chain", description=__doc__)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--quick", action="store_true", help="two views, two frames, three trials an arm")
    options = parser.parse_args()
    folder: Path = options.out
    folder.mkdir(parents=True, exist_ok=True)
    views, frames, trials = (
        (QUICK_VIEWS, QUICK_FRAMES, QUICK_TRIALS) if options.quick else (VIEWS, FRAMES, TRIALS)
    )  # fmt: skip
    see(folder / "views", "views", views)
    see(folder / "motion", "motion", frames)
    arms = [word for arm in ARM_NAMES for word in ("--arms", arm)]
    seeds = ("--trials", str(trials), "--seed", str(SEED))
    command("suture", "simulate", *arms, *seeds, "--record", "ours", "--out", folder / "trials")
    command("suture", "evaluate", "--trials", folder / "trials", "--out", folder / "evaluation")
    command(
        "report", "--sequence", folder / "motion" / "disparity", "--suture-needle", folder / "motion" / "needle",
        "--suture-thread", folder / "motion" / "thread", "--suture-trial", folder / "trials", "--suture-evaluation",
        folder / "evaluation", "--out", folder / "report",
    )  # fmt: skip
    gather(folder)
    print(folder / "table.md")


def gather(folder: Path) -> None:
    """Write the example's figures; their cases begin with `chain_`, as they are of few views and trials."""
    figures: dict[str, float] = {}
    texts = []
    for part in ("views", "motion", ""):
        evaluation = folder / part / "evaluation"
        told = json.loads((evaluation / "metrics.json").read_text(encoding="utf-8"))["metrics"]
        for name, value in told.items():
            arm, case, measure = name.split("/")
            figures[f"{arm}/chain_{part}{'_' if part else ''}{case}/{measure}"] = value
        title = part or "trials"
        texts.append(f"## Example: {title}\n\n" + (evaluation / "table.md").read_text(encoding="utf-8").strip())
    (folder / "metrics.json").write_text(json.dumps(figures, indent=1, sort_keys=True) + "\n")
    (folder / "table.md").write_text("\n\n".join(texts) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
