"""Coverage-guided fuzzing with atheris: python -m tests.fuzz.run --seconds 60 [HARNESS...] (make fuzz).

Every harness runs in a process of its own, with caps on memory (2 GiB) and on the time of one input (10 s), from the
committed corpus. The input that breaks a parser is written to outputs/fuzz/<harness>/; once fixed, put it into
tests/fuzz/corpus/<harness>/crash-<what> so that the suite replays it.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
import traceback
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path

from tests.fuzz.harness import corpus_of
from tests.fuzz.registry import INSTRUMENTED, NAMES

REPOSITORY = Path(__file__).resolve().parents[2]
MEMORY_LIMIT = 2048
"""MiB."""
INPUT_SECONDS = 10


@dataclass(frozen=True)
class Outcome:
    """What fuzzing one harness gave."""

    harness: str
    seconds: float
    executions: int
    branches: int
    """Edges of our code that were reached."""
    inputs: int
    """Inputs that reached something new."""
    found: tuple[str, ...]
    """Files of inputs that broke the parser."""
    message: str = ""


def fuzz(name: str, seconds: int, findings: Path, seed: int) -> Outcome:
    """Fuzz one harness in a new process."""
    folder = findings / name
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as scratch:
        corpus, current = Path(scratch) / "corpus", Path(scratch) / "current"
        corpus.mkdir()
        for path in corpus_of(name):
            shutil.copy(path, corpus)
        environment = {**os.environ, "NUMBA_DISABLE_JIT": "1", "PYTHONPATH": str(REPOSITORY)}
        started = time.monotonic()
        done = subprocess.run(
            [
                sys.executable,
                "-m",
                "tests.fuzz.run",
                "--worker",
                name,
                "--seconds",
                str(seconds),
                "--seed",
                str(seed),
                "--corpus",
                str(corpus),
                "--current",
                str(current),
            ],
            cwd=REPOSITORY,
            env=environment,
            capture_output=True,
            text=True,
            errors="replace",
        )
        inputs = len(list(corpus.iterdir()))
        if done.returncode != 0 and current.exists():
            data = current.read_bytes()
            (folder / f"crash-{hashlib.sha256(data).hexdigest()[:12]}").write_bytes(data)
    text = done.stderr + done.stdout
    runs = re.findall(r"^#(\d+)\s+\w+.*?cov: (\d+)", text, re.MULTILINE)
    total = re.search(r"Done (\d+) runs", text)
    executions = int(total[1]) if total else int(runs[-1][0]) if runs else 0
    found = tuple(sorted(path.name for path in folder.iterdir()))
    message = "" if done.returncode == 0 else _last_error(text)
    return Outcome(
        name,
        round(time.monotonic() - started, 1),
        executions,
        max((int(c) for _, c in runs), default=0),
        inputs,
        found,
        message,
    )


def _last_error(text: str) -> str:
    raised = re.findall(
        r"^(?:[A-Za-z_.]+(?:Error|Exception|Interrupt|Failure|Input)\b.*|ERROR: libFuzzer.*)", text, re.MULTILINE
    )
    lines = [line for line in text.splitlines() if line.strip()]
    return " ".join((raised or lines or ["no output"])[-1].split())[:200]


def work(name: str, seconds: int, corpus: Path, current: Path, seed: int) -> None:
    """Fuzz one harness in this process; does not return. `current` holds the input that it is at."""
    import atheris

    from tests.fuzz.registry import load

    with atheris.instrument_imports(include=INSTRUMENTED):
        harness = load(name)
    harness.seeds()  # what is loaded late is loaded now

    def target(data: bytes) -> None:
        current.write_bytes(data)
        started = time.monotonic()
        try:
            harness.target(data)
            if time.monotonic() - started > INPUT_SECONDS:
                raise RuntimeError(f"one input took {time.monotonic() - started:.0f} s")
        except Exception:
            traceback.print_exc()
            sys.stderr.flush()
            os._exit(1)

    atheris.Setup(
        [
            sys.argv[0],
            str(corpus),
            f"-max_total_time={seconds}",
            f"-rss_limit_mb={MEMORY_LIMIT}",
            f"-seed={seed}",
            f"-timeout={3 * INPUT_SECONDS}",
            f"-max_len={harness.largest}",
            f"-artifact_prefix={current}-",
        ],
        target,
    )
    atheris.Fuzz()


def table_of(outcomes: list[Outcome]) -> str:
    """Return the outcomes as a Markdown table."""
    lines = ["| harness | seconds | executions | edges | inputs kept | found |", "|---|---|---|---|---|---|"]
    for o in outcomes:
        found = f"{len(o.found)}: {o.message}" if o.found or o.message else "nothing"
        lines.append(f"| {o.harness} | {o.seconds:.0f} | {o.executions} | {o.branches} | {o.inputs} | {found} |")
    total = sum(o.executions for o in outcomes)
    lines.append(f"| all {len(outcomes)} | {sum(o.seconds for o in outcomes):.0f} | {total} | | | |")
    return "\n".join(lines)


def main() -> int:
    """Fuzz the harnesses named, or all; exit code 1 when something was found, 5 without atheris."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("harness", nargs="*", help=f"of {', '.join(NAMES)}")
    parser.add_argument("--seconds", type=int, default=60, help="of every harness")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=1, help="harnesses at once")
    parser.add_argument("--findings", type=Path, default=Path("outputs/fuzz"))
    parser.add_argument("--out", type=Path, help="JSON file of the outcomes")
    parser.add_argument("--worker", help=argparse.SUPPRESS)
    parser.add_argument("--corpus", type=Path, help=argparse.SUPPRESS)
    parser.add_argument("--current", type=Path, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.worker:
        work(options.worker, options.seconds, options.corpus, options.current, options.seed)
    unknown = sorted(set(options.harness) - set(NAMES))
    if unknown:
        parser.error(f"no harness {unknown[0]!r}; there are: {', '.join(NAMES)}")
    try:
        import atheris  # noqa: F401
    except ImportError:
        print("error: atheris is not installed (pip install scenewright[fuzz])", file=sys.stderr)
        return 5
    findings = options.findings.resolve()

    def one(name: str) -> Outcome:
        outcome = fuzz(name, options.seconds, findings, options.seed)
        print(table_of([outcome]).splitlines()[2], file=sys.stderr, flush=True)
        return outcome

    with ThreadPoolExecutor(options.jobs) as pool:
        outcomes = list(pool.map(one, options.harness or NAMES))
    print(table_of(outcomes))
    if options.out:
        options.out.write_text(json.dumps([asdict(outcome) for outcome in outcomes], indent=1) + "\n")
    return 1 if any(outcome.found or outcome.message for outcome in outcomes) else 0


if __name__ == "__main__":
    sys.exit(main())
