"""Throws hostile inputs, streams and surroundings at the command line of a checkout, and counts what fell.

    python -m tests.reliability.attacks [--checkout OTHER] [--only AREA ...] [--out attacks.json]

A command fell when it ended with a code that docs/ARCHITECTURE.md does not list or with 1, wrote a traceback, let an
escape sequence through, or had to be ended after 20 s or at 4 GiB.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import shlex
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from tests.bad_input.hostile_artifacts import artifact, chain, cycle, ladder
from tests.reliability.running import REPOSITORY

CODES = (0, 2, 3, 4, 5, 6, 130)
SECONDS = 20
LARGEST = 4 * 2**30
START = [sys.executable, "-c", "from scenewright.cli.main import main; main()"]
FULL = ("", ">&-", "> /dev/full", ">&- 2>&-", "<&- >&- 2>&-")
STREAMS = (*FULL[1:], "2>&-", "2> /dev/full", "| head -c1")


@dataclass(frozen=True)
class Case:
    """A command line; `streams` is what the shell adds, `gone`: its folder is deleted first."""

    area: str
    words: tuple[str, ...]
    streams: str = ""
    gone: bool = False
    code: int | None = None
    """The only exit code that will do."""


def prepare(root: Path) -> None:
    """Write what the cases name."""
    for place in ("sparse", "pipe", "device"):
        folder = root / "not" / "beside" / "the" / place  # where `gc` does not look for neighbours of the others
        artifact(folder).joinpath("manifest.json").unlink()
        if place == "pipe":
            os.mkfifo(folder / "manifest.json")
        elif place == "device":
            (folder / "manifest.json").symlink_to("/dev/zero")
        else:
            (folder / "manifest.json").touch()
            os.truncate(folder / "manifest.json", 10 * 2**30)
    artifact(root / "piped" / "x")
    os.mkfifo(root / "piped" / ".x.journal")
    named = {"zero": "a\0b", "long": "a" * 5000, "empty": "", "own": "../x", "loop": "../a", "escape": "../\x1b[2J\x07"}
    for name, path in named.items():
        artifact(root / name / "x", path)
    (root / "loop" / "a").symlink_to("b")
    (root / "loop" / "b").symlink_to("a")
    cycle(root / "cycle").rename(root / "cycle" / "x")
    artifact(root / "cycle" / "second", "../x")
    artifact(root / "cycle" / "x", "../second")
    ladder(root / "ladder", 30).rename(root / "ladder" / "x")
    chain(root / "chain", 1500).rename(root / "chain" / "x")
    artifact(root / "memory" / "x", provenance={"peak_memory_bytes": 10**399})
    artifact(root / "bytes" / "x", files=[{"path": "a", "bytes": 10**399, "sha256": "0"}])
    artifact(root / "wide" / "x", parameters={f"parameter_{number}": "x" * 100 for number in range(20_000)})
    os.mkfifo(root / "pipe.toml")
    (root / "endless.toml").symlink_to("/dev/zero")
    (root / "deep.toml").write_text("x = " + "[" * 100_000)
    (root / "digits.toml").write_text("pipeline = " + "9" * 6000)
    (root / "dots.toml").write_text("a." * 1_000_000 + "b = 1\n")
    (root / "latin.toml").write_bytes(b'name = "caf\xe9"\n')


def cases(root: Path) -> Iterator[Case]:
    """Yield every case."""
    out = ("--out", str(root / "out"))
    odd = root / "not" / "beside" / "the"
    for place in ("sparse", "pipe", "device"):
        folder = str(odd / place)
        yield Case("manifest", ("migrate", folder, *out))
        yield Case("manifest", ("report", "--sequence", folder, *out))
        yield Case("manifest", ("diff", folder, str(root / "wide" / "x")))
        yield from (Case("manifest", (name, folder)) for name in ("inspect", "verify", "timeline", "gc"))
    yield from (Case("manifest", (name, str(root / "piped" / "x"))) for name in ("inspect", "verify", "gc"))
    for name in ("zero", "long", "empty", "own", "loop", "cycle", "ladder", "chain"):
        yield Case("graph", ("verify", str(root / name / "x")))
        yield Case("graph", ("gc", str(root / name)))
        yield Case("graph", ("inspect", str(root / name / "x")))
    for name in ("memory", "bytes"):
        yield Case("digits", ("diff", *[str(root / name / "x")] * 2))
        yield from (Case("digits", (command, str(root / name / "x"))) for command in ("inspect", "verify"))
    yield from (Case("escapes", (name, str(root / "escape" / "x"))) for name in ("inspect", "verify", "gc"))
    for name in ("pipe", "endless", "deep", "digits", "dots", "latin"):
        file = str(root / f"{name}.toml")
        yield Case("settings", ("batch", file, *out))
        yield Case("settings", ("run", file, *out))
        yield Case("settings", ("fuse", "--config", file, "--sequence", "x", "--segments", "x", *out))
    long = "x" * 5000
    yield Case("paths", ("makefile", long), code=2)
    yield Case("paths", ("run", long, *out), code=2)
    yield Case("paths", ("diff", long, str(root)))
    yield Case("paths", ("models", "--check", long))
    yield Case("paths", ("diff", "/", "/"))
    yield from (Case("paths", (name, long)) for name in ("inspect", "verify", "gc", "timeline"))
    wide = str(root / "wide" / "x")
    for words in (
        ("--help",),
        ("fuse", "--help"),
        ("--version",),
        ("inspect", wide, "--json"),
        ("models", "--json"),
        ("gc", wide, "--json"),
        ("diff", wide, wide, "--json"),
        ("nonsense",),
    ):
        for streams in STREAMS:
            written = words != ("nonsense",) and streams in FULL
            yield Case("streams", words, streams, code=6 if written else None)
    yield from (Case("surroundings", words, gone=True, code=6) for words in (("gc",), ("--help",), ("inspect", wide)))


def fell(case: Case, checkout: Path, folder: Path) -> str:
    """Run a case; return why it fell, empty when it stood."""
    line = f"{shlex.join([*START, *case.words])} {case.streams}"
    if case.gone:
        folder.mkdir()
        line = f"rmdir {shlex.quote(str(folder))} && {line}"
    process = subprocess.Popen(
        ["bash", "-o", "pipefail", "-c", line],
        cwd=folder if case.gone else checkout,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        env={**os.environ, "PYTHONPATH": str(checkout)},
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_AS, (LARGEST, LARGEST)),
        start_new_session=True,
    )
    try:
        data, said = process.communicate(timeout=SECONDS)
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, 9)
        process.communicate()
        return "does not end"
    if process.returncode not in (CODES if case.code is None else (case.code,)):
        return f"exit {process.returncode}: {said.decode(errors='replace').strip()[-200:]}"
    if b"Traceback" in said or b"internal error" in said:
        return "traceback"
    return "escape sequence" if b"\x1b" in data + said else ""


def main() -> int:
    """Run the cases; exit code 1 when anything fell."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--checkout", type=Path, default=REPOSITORY)
    parser.add_argument("--only", nargs="*")
    parser.add_argument("--out", type=Path)
    options = parser.parse_args()
    counts: dict[str, dict[str, int]] = {}
    with tempfile.TemporaryDirectory() as folder:
        root = Path(folder).resolve()
        prepare(root)
        for case in cases(root):
            if options.only and case.area not in options.only:
                continue
            reason = fell(case, options.checkout.resolve(), root / "gone")
            count = counts.setdefault(case.area, {"tried": 0, "failed": 0})
            count["tried"] += 1
            count["failed"] += bool(reason)
            words = shlex.join(case.words)[:80]
            print(f"{'fell ' if reason else 'stood'} {case.area}: {words} {case.streams} {reason}", flush=True)
    if options.out:
        options.out.write_text(json.dumps(counts, indent=1) + "\n")
    print(counts)
    return int(any(count["failed"] for count in counts.values()))


if __name__ == "__main__":
    sys.exit(main())
