"""Interrupts every step of the demo chain at random moments, then asks whether anything was lost.

    python -m tests.reliability.kill_chain --kills 200 --seed 1 --out kills.json

A trial runs one step on finished inputs as the command line does, half of the time over an artifact that stands there
already, stops it (SIGSTOP) at a chosen moment, looks at what lies on the disk, sends SIGKILL, SIGINT or SIGTERM, and
demands of what is left: the previous artifact byte for byte, or the whole new one, or nothing where nothing was. Then
the same command runs again, has to end with the digest of the undisturbed run, and to leave only its lock file.
"""

from __future__ import annotations

import argparse
import json
import random
import re
import shutil
import signal
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path

from scenewright.schemas.manifest import MANIFEST_NAME, Manifest
from scenewright.stages.engine.digests import content_digest, record_files
from scenewright.stages.engine.pipelines import pipeline_path, read_pipeline, resolve_variables, step_arguments
from scenewright.stages.engine.reading import open_artifact

REPOSITORY = Path(__file__).resolve().parents[2]
SMALL = {"frames": "16", "width": "160", "height": "120", "voxel_size": "0.05", "seed": "3"}
PIPELINE = read_pipeline(pipeline_path("demo"))
STEPS = tuple(step.name for step in PIPELINE.step)
SLOW = ("ground_truth", "cad_scene", "plan", "geometric_evaluation", "evaluation")
"""Interrupted half as often as the others."""
SIGNALS = (signal.SIGKILL, signal.SIGINT, signal.SIGTERM)
COMMIT_SECONDS = 0.06
"""About what hashing, flushing and exchanging takes in this chain."""
PHASES = ("before work", "during work", "committing", "after")
WITHOUT_EXCHANGE = (
    "from scenewright.stages.engine import interruption; interruption.install(); "
    "from scenewright.cli.main import main; "
    "import scenewright.stages.engine.store as store; store.exchange = lambda first, second: False; main()"
)
"""The command line on a file system that cannot exchange two folders in one step."""


@dataclass(frozen=True)
class Trial:
    """What one interruption did. `problems` is empty when nothing was lost."""

    step: str
    signal: str
    previous: bool
    """Whether an artifact stood there before."""
    atomic: bool
    """Whether the file system could exchange folders in one step."""
    phase: str
    """Where the step was: one of PHASES."""
    left: str
    """What lay on the disk once the process was gone: `previous`, `new` or `nothing`, `+` what will be swept."""
    exit_code: int
    seconds_to_exit: float
    """From the signal to the end of the process."""
    resumed: str
    """What the next run said: `made` or `up to date`."""
    resume_seconds: float
    problems: tuple[str, ...]


def scenewright(words: list[str], *, atomic: bool = True) -> subprocess.Popen[str]:
    """Start a command line in a process of its own."""
    start = [sys.executable, "-m", "scenewright"] if atomic else [sys.executable, "-c", WITHOUT_EXCHANGE]
    return subprocess.Popen([*start, *words], cwd=REPOSITORY, text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE)


def run_whole_chain(folder: Path) -> dict[str, float]:
    """Make every artifact of the small chain under `folder`. Returns step -> seconds from start to exit."""
    seconds = {}
    for name in STEPS:
        started = time.monotonic()
        process = scenewright([*arguments_of(name, folder, folder / name), "--quiet", "--json"])
        _, errors = process.communicate()
        if process.returncode != 0:
            raise SystemExit(f"{name} fails undisturbed: {errors.strip()[-400:]}")
        seconds[name] = time.monotonic() - started
        print(f"{name:22} {seconds[name]:6.1f} s", file=sys.stderr, flush=True)
    return seconds


def arguments_of(name: str, folder: Path, out: Path, settings: Mapping[str, str] = SMALL) -> list[str]:
    """Return the words after `scenewright` of one step on the inputs in `folder`, writing to `out`."""
    step = next(step for step in PIPELINE.step if step.name == name)
    return [*step_arguments(step, str(folder), resolve_variables(PIPELINE, settings))[:-1], str(out)]


def older_version(clean: Path, target: Path) -> str:
    """Write a sound artifact that is not what the step makes: one file more, another key. Returns its digest."""
    shutil.copytree(clean, target)
    (target / "older.txt").write_text("of an earlier run\n")
    artifact = open_artifact(target)
    assert artifact.manifest is not None
    records = record_files(target, artifact.undigested)
    older = artifact.manifest.model_copy(
        update={"files": records, "content_digest": content_digest(records), "key": "0" * 64}
    )
    older.write(target / MANIFEST_NAME)
    return older.content_digest


def digest_on_disk(folder: Path) -> str:
    """Return the digest of the bytes that lie in an artifact folder, `damaged` when its manifest tells another."""
    artifact = open_artifact(folder)
    assert artifact.manifest is not None
    found = content_digest(record_files(folder, artifact.undigested))
    return found if found == artifact.manifest.content_digest else "damaged"


def state_on_disk(out: Path, clean: str, older: str | None) -> tuple[str, str]:
    """Return (what stands at `out`, what will be swept) by name."""
    if not out.exists():
        stands = "nothing"
    else:
        digest = digest_on_disk(out)
        stands = {clean: "new", older: "previous"}.get(digest, digest)
    found = [path.name for path in out.parent.iterdir() if path.name.startswith(f".{out.name}.")]
    beside = [re.sub(rf"^\.{re.escape(out.name)}\.(\w+).*", r"\1", name) for name in found]
    return stands, " ".join(sorted(set(beside) - {"lock"}))


def phase_of(out: Path, previous: Path | None) -> str:
    """Tell from the disk how far a stopped step is."""
    partial = list(out.parent.glob(f".{out.name}.partial-*"))
    manifest = out / MANIFEST_NAME
    replaced = manifest.exists() and (previous is None or manifest.read_bytes() != previous.read_bytes())
    if replaced and not partial:
        return "after"
    if replaced or any((folder / "timings.json").exists() for folder in partial):
        return "committing"
    return "during work" if partial else "before work"


def wait_for_moment(process: subprocess.Popen[str], out: Path, moment: float, seconds: float) -> None:
    """Return at the moment (0..1 of the undisturbed run's `seconds`; above 1: after the payload is written)."""
    deadline = time.monotonic() + 600
    if moment <= 1:
        while time.monotonic() < deadline - 600 + moment * seconds and process.poll() is None:
            time.sleep(0.001)
        return
    while process.poll() is None and time.monotonic() < deadline:
        if any((entry / "timings.json").exists() for entry in out.parent.glob(f".{out.name}.partial-*")):
            time.sleep((moment - 1) * COMMIT_SECONDS)
            return
        time.sleep(0.0002)


def run_trial(
    name: str,
    runs: Path,
    work: Path,
    seconds: float,
    moment: float,
    how: signal.Signals,
    previous: bool,
    atomic: bool,
    settings: Mapping[str, str] = SMALL,
) -> Trial:
    """Interrupt one step once. `work` is emptied; `runs` holds the undisturbed run that has these settings."""
    shutil.rmtree(work, ignore_errors=True)
    work.mkdir(parents=True)
    out = work / name
    clean = Manifest.read(runs / name / MANIFEST_NAME).content_digest
    older = older_version(runs / name, out) if previous else None
    kept = work / "previous-manifest.json"
    if previous:
        shutil.copy(out / MANIFEST_NAME, kept)
    words = [*arguments_of(name, runs, out, settings), "--json"]
    process = scenewright([*words, "--quiet"], atomic=atomic)
    wait_for_moment(process, out, moment, seconds)
    process.send_signal(signal.SIGSTOP)
    phase = phase_of(out, kept if previous else None)
    started = time.monotonic()
    process.send_signal(how)
    process.send_signal(signal.SIGCONT)
    _, errors = process.communicate()
    took = time.monotonic() - started
    stands, beside = state_on_disk_when_readable(out, clean, older)
    problems = _complaints(stands, previous, how, phase, process.returncode, errors)
    started = time.monotonic()
    resume = scenewright(words, atomic=atomic)
    output, errors = resume.communicate()
    resume_seconds = round(time.monotonic() - started, 3)
    facts = json.loads(output) if output.strip() else {}
    if resume.returncode != 0:
        problems.append(f"the next run exits with {resume.returncode}: {errors.strip()[-200:]}")
    else:
        if digest_on_disk(out) != clean:
            problems.append("the next run gives another digest than an undisturbed one")
        _, beside_after = state_on_disk(out, clean, older)
        if beside_after:
            problems.append(f"left over after the next run: {beside_after}")
    return Trial(
        name,
        how.name,
        previous,
        atomic,
        phase,
        stands + (f" + {beside}" if beside else ""),
        process.returncode,
        round(took, 3),
        facts.get("status", "?"),
        resume_seconds,
        tuple(problems),
    )


def state_on_disk_when_readable(out: Path, clean: str, older: str | None) -> tuple[str, str]:
    """As `state_on_disk`, for a target whose journalled replacement a reader has to complete first."""
    beside = state_on_disk(out, clean, older)[1] if not out.exists() else ""
    if "journal" in beside:
        open_artifact(out)  # any reader completes it
        return state_on_disk(out, clean, older)[0], f"{beside} (completed by the first reader)"
    return state_on_disk(out, clean, older)


def _complaints(stands: str, previous: bool, how: signal.Signals, phase: str, code: int, errors: str) -> list[str]:
    problems = []
    if code == 0 and phase in ("before work", "during work"):
        problems.append(f"{how.name} was not heard")
    if stands not in ("new", "previous" if previous else "nothing"):
        problems.append(f"what stands there is {stands}")
    if how != signal.SIGKILL and code != 0:
        lines = [line for line in errors.splitlines() if line.strip()]
        if code == -how and not lines:
            return problems  # the interpreter itself was still starting
        if code != 130:
            problems.append(f"exit code {code} after {how.name}: {errors.strip()[-300:]}")
        elif len([line for line in lines if line.startswith("error:")]) != 1 or "Traceback" in errors:
            problems.append(f"not one line after {how.name}: {errors.strip()[-300:]}")
    return problems


def plan_of(kills: int, seed: int, steps: tuple[str, ...]) -> list[tuple[str, float, signal.Signals, bool, bool]]:
    """Return (step, moment, signal, previous, atomic) for every trial: moments at random, slow steps half as often.

    Two of three moments are uniform over the undisturbed duration; one of three falls into COMMIT_SECONDS after the
    payload is complete, in which the artifact is hashed, flushed and takes its place.
    """
    rng = random.Random(seed)
    turns = [(turn, step) for turn in range(kills) for step in steps if turn % 2 == 0 or step not in SLOW]
    trials = []
    for number, (turn, step) in enumerate(turns[:kills]):
        moment = 1 + rng.random() if turn % 3 == 2 else rng.random()
        trials.append((step, moment, SIGNALS[(number + turn) % 3], rng.random() < 0.5, rng.random() < 0.75))
    return trials


def run_experiment(
    kills: int, seed: int, folder: Path, runs: Path | None = None, report: Callable[[Trial], None] = lambda trial: None
) -> list[Trial]:
    """Run the chain once undisturbed (or take `runs`, which somebody made), then all trials."""
    folder.mkdir(parents=True, exist_ok=True)
    if runs is None:
        runs = folder / "undisturbed"
        run_whole_chain(runs)
        seconds = run_whole_chain(folder / "warm")  # compiled and cached
    else:
        seconds = {name: Manifest.read(runs / name / MANIFEST_NAME).provenance.seconds + 1.0 for name in STEPS}
    trials = []
    for step, moment, how, previous, atomic in plan_of(kills, seed, STEPS):
        trial = run_trial(step, runs, folder / "trial", seconds[step], moment, how, previous, atomic)
        trials.append(trial)
        report(trial)
        if trial.resumed == "made":  # under the load of this minute
            seconds[step] = trial.resume_seconds
        elif moment <= 1:
            seconds[step] *= 0.8
    return trials


def table_of(trials: list[Trial]) -> str:
    """Return the trials as a Markdown table, one line a step."""
    head = ["step", *(s.name for s in SIGNALS), *PHASES, "previous stood", "new stood", "nothing stood"]
    lines = ["| " + " | ".join([*head, "to be swept", "equal after resume"]) + " |", "|---" * (len(head) + 2) + "|"]
    for name in (*dict.fromkeys(trial.step for trial in trials), "all"):
        own = [trial for trial in trials if name in (trial.step, "all")]
        by_signal, by_phase = Counter(t.signal for t in own), Counter(t.phase for t in own)
        stood = Counter(t.left.split()[0] for t in own)
        cells = [by_signal[s.name] for s in SIGNALS] + [by_phase[phase] for phase in PHASES]
        cells += [stood[word] for word in ("previous", "new", "nothing")]
        cells.append(sum("+" in t.left for t in own))
        lines.append(
            f"| {name} | " + " | ".join(map(str, cells)) + f" | {sum(not t.problems for t in own)}/{len(own)} |"
        )
    return "\n".join(lines)


def main() -> int:
    """Run the experiment and print its table; exit code 1 when anything was lost."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--kills", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--folder", type=Path, default=Path("outputs/experiments/kills"), help="where it works")
    parser.add_argument("--runs", type=Path, help="a finished small demo run to take inputs from")
    parser.add_argument("--out", type=Path, help="JSON file of all trials")
    options = parser.parse_args()

    def say(trial: Trial) -> None:
        words = [trial.step, trial.signal, trial.phase, trial.left, str(trial.exit_code), f"{trial.seconds_to_exit} s"]
        print("; ".join([*words, trial.resumed, *trial.problems]), file=sys.stderr, flush=True)

    trials = run_experiment(options.kills, options.seed, options.folder.resolve(), options.runs, say)
    print(table_of(trials))
    slow = sorted(t.seconds_to_exit for t in trials if t.signal != "SIGKILL") or [0.0]
    print(f"\nfrom signal to exit: median {slow[len(slow) // 2]:.2f} s, slowest {slow[-1]:.2f} s")
    if options.out:
        options.out.write_text(json.dumps([asdict(trial) for trial in trials], indent=1) + "\n")
    return 1 if any(trial.problems for trial in trials) else 0


if __name__ == "__main__":
    sys.exit(main())
