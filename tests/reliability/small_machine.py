"""Runs every step of the demo chain on a disk that is too small, and with too little memory.

    python -m tests.reliability.small_machine --runs FOLDER --out machine.json

FOLDER holds a finished run of the small chain (tests/reliability/kill_chain.py makes one). Each step writes to a file
system in memory that holds a half of its artifact (needs the right to mount), then runs with its address space limited
to less than it takes. Exit code 6 and one line are demanded, and that nothing is left but the lock file.
"""

from __future__ import annotations

import argparse
import json
import resource
import subprocess
import sys
import tempfile
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path

from scenewright.schemas.manifest import MANIFEST_NAME, Manifest

from tests.reliability.kill_chain import REPOSITORY, STEPS, arguments_of

GIBIBYTE = 2**30


@dataclass(frozen=True)
class Shortage:
    """What a step said when it ran out of something."""

    step: str
    of: str
    """`disk` or `memory`."""
    limit: int
    """Bytes."""
    exit_code: int
    error: str
    left: tuple[str, ...]
    """What lay beside the output afterwards, the lock file aside."""


def run_limited(name: str, runs: Path, out: Path, limit: Callable[[], None] | None) -> tuple[int, str]:
    """Run one step; returns its exit code and its line of error, or the end of what it said."""
    done = subprocess.run(
        [sys.executable, "-m", "scenewright", *arguments_of(name, runs, out), "--quiet"],
        cwd=REPOSITORY,
        capture_output=True,
        text=True,
        errors="replace",
        preexec_fn=limit,
    )
    lines = [line for line in done.stderr.splitlines() if line.startswith("error:")]
    return done.returncode, lines[0] if len(lines) == 1 else done.stderr.strip()[-200:]


def left_beside(out: Path) -> tuple[str, ...]:
    """Return what is there besides the lock file."""
    return tuple(sorted(path.name for path in out.parent.iterdir() if path.name != f".{out.name}.lock"))


def on_a_small_disk(name: str, runs: Path) -> Shortage:
    """Run a step into a file system that holds half of what it writes."""
    size = max(16384, sum(record.bytes for record in Manifest.read(runs / name / MANIFEST_NAME).files) // 2)
    with tempfile.TemporaryDirectory() as folder:
        subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={size}", "tmpfs", folder], check=True)
        try:
            code, error = run_limited(name, runs, Path(folder) / name, None)
            return Shortage(name, "disk", size, code, error, left_beside(Path(folder) / name))
        finally:
            subprocess.run(["umount", "-l", folder], check=True)


def with_little_memory(name: str, runs: Path) -> Shortage:
    """Run a step with the largest address space, of a few, in which it cannot end."""
    found = None
    for limit in (GIBIBYTE * share // 4 for share in (8, 5, 3)):
        with tempfile.TemporaryDirectory() as folder:
            out = Path(folder) / name
            code, error = run_limited(name, runs, out, lambda: resource.setrlimit(resource.RLIMIT_AS, (limit, limit)))  # noqa: B023
            if code != 0:
                found = Shortage(name, "memory", limit, code, error, left_beside(out))
                break
    return found or Shortage(name, "memory", 0, 0, "it ended with every limit", ())


def main() -> int:
    """Run the experiment; exit code 1 unless every step behaved."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=Path, required=True)
    parser.add_argument("--only", nargs="*", default=STEPS)
    parser.add_argument("--out", type=Path)
    options = parser.parse_args()
    shortages = []
    for name in options.only:
        for shortage in (
            on_a_small_disk(name, options.runs.resolve()),
            with_little_memory(name, options.runs.resolve()),
        ):
            shortages.append(shortage)
            s = shortage
            print(
                f"| {s.step} | {s.of} | {s.limit / 2**20:.2f} MiB | {s.exit_code} | {s.error} | {', '.join(s.left)} |",
                flush=True,
            )
    if options.out:
        options.out.write_text(json.dumps([asdict(shortage) for shortage in shortages], indent=1) + "\n")
    return int(any(shortage.exit_code != 6 or shortage.left for shortage in shortages))


if __name__ == "__main__":
    sys.exit(main())
