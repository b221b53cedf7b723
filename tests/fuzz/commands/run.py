"""Fuzzing the commands: python -m tests.fuzz.commands.run --minutes 10 (make fuzz MINUTES=10).

Draws a command, its options and edits of what it reads, case by case from a seed, and runs it in a fork. A find is what
ended with exit 1, another code than docs/ARCHITECTURE.md lists or a signal, wrote a traceback or more than one line of
error, did not end, took more than 2 GiB, changed what it read or left half an artifact. Each is made smaller and kept
in outputs/fuzz/commands/found/; once mended, put it into tests/fuzz/corpus/commands/ so that the suite replays it.
"""

from __future__ import annotations

import argparse
import atexit
import json
import shutil
import sys
import tempfile
import time
from collections import Counter
from dataclasses import replace
from pathlib import Path

from tests.fuzz.commands import base as base_artifacts
from tests.fuzz.commands import forking
from tests.fuzz.commands.case import Case, read_case
from tests.fuzz.harness import CORPUS

COMMANDS = CORPUS / "commands"
MOST_TRIES = 25
"""Runs that making a case smaller may take."""


def smaller(case: Case) -> list[Case]:
    """Return the case without each of its edits, and without each of its options."""
    fewer = [replace(case, edits=case.edits[:k] + case.edits[k + 1 :]) for k in range(len(case.edits))]
    words = case.words
    for k, word in enumerate(words):
        if word.startswith("--") and word not in ("--out", "--dry-run"):
            valued = k + 1 < len(words) and not words[k + 1].startswith("--")
            fewer.append(replace(case, words=words[:k] + words[k + 1 + valued :]))
    return fewer


def minimised(case: Case, name: str, base: Path, root: Path) -> Case:
    """Return the smallest case found that fails in the same way."""
    from tests.fuzz.commands.judging import judge

    tries = 0
    shrunk = True
    while shrunk and tries < MOST_TRIES:
        shrunk = False
        for candidate in smaller(case):
            tries += 1
            if tries > MOST_TRIES:
                break
            if judge(candidate, base, root).name == name:
                case, shrunk = candidate, True
                break
    return case


def main() -> int:
    """Fuzz for some minutes of processor time; exit code 1 when something was found."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--minutes", type=float, default=10.0, help="of processor time")
    parser.add_argument("--seed", type=int, default=0, help="of the first case; each next one has the next")
    parser.add_argument("--count", type=int, help="cases instead of minutes")
    parser.add_argument("--only", nargs="*", help="commands: 'library add', inspect")
    parser.add_argument("--base", type=Path, help="small artifacts, made when missing [outputs/fuzz/base]")
    parser.add_argument("--found", type=Path, default=Path("outputs/fuzz/commands/found"))
    parser.add_argument("--replay", nargs="*", type=Path, help="cases to run instead; none: the corpus")
    parser.add_argument("--out", type=Path, help="JSON file of what was tried and what fell")
    options = parser.parse_args()
    memory = Path("/dev/shm")
    root = Path(tempfile.mkdtemp(prefix="fuzz-commands-", dir=memory if memory.is_dir() else None))
    atexit.register(shutil.rmtree, root, ignore_errors=True)
    base = (options.base or Path("outputs/fuzz/base")).resolve()
    if options.replay is not None and options.base is None:
        base = root / "base"
        base_artifacts.take(base)
    elif not (base / base_artifacts.FOREIGN / "scenenn").exists():
        base_artifacts.make(base)
    forking.settle_environment()
    forking.import_everything()
    from tests.fuzz.commands.drawing import draw_case
    from tests.fuzz.commands.judging import judge
    from tests.fuzz.commands.workspace import stamps_of

    place = root / "case"
    tried: Counter[str] = Counter()
    fell: Counter[str] = Counter()
    codes: Counter[int] = Counter()
    cpu: Counter[str] = Counter()
    found: dict[str, dict[str, object]] = {}
    stamps = stamps_of([base])
    started, last, used, seed = time.monotonic(), time.monotonic(), 0.0, options.seed
    if options.replay is not None:
        queue = [read_case(path) for path in options.replay or sorted(COMMANDS.glob("*.json"))]
    while True:
        if options.replay is not None:
            if not queue:
                break
            case = queue.pop(0)
        elif sum(tried.values()) >= options.count if options.count else used > 60 * options.minutes:
            break
        else:
            case = draw_case(seed, base)
            seed += 1
        if options.only and case.command not in options.only:
            continue
        before = time.process_time()
        verdict = judge(case, base, place, stamps)
        used += verdict.cpu_seconds + time.process_time() - before
        tried[case.command] += 1
        codes[verdict.code] += 1
        cpu[case.command] += verdict.cpu_seconds
        if verdict.reason:
            fell[case.command] += 1
            if verdict.name not in found:
                whole = options.replay is not None or verdict.reason in ("does not end", "memory")
                small = case if whole else minimised(case, verdict.name, base, place)
                again = verdict if small == case else judge(small, base, place)
                entry = {"name": verdict.name, "seed": seed - 1, "said": (again.said or verdict.said)[-600:]}
                found[verdict.name] = entry
                options.found.mkdir(parents=True, exist_ok=True)
                (options.found / f"{case.command.replace(' ', '_')}-{seed - 1}.json").write_text(small.text())
                print(f"\n{seed - 1} {verdict.name}\n  {' '.join(small.words)}\n  {small.edits}", flush=True)
                print("  " + str(entry["said"]).strip()[-400:].replace("\n", "\n  "), flush=True)
        elif options.replay is not None:
            print(f"stood: {' '.join(case.words)[:100]} (exit {verdict.code})")
        if time.monotonic() - last > 60:
            last = time.monotonic()
            rate = sum(tried.values()) / (last - started)
            print(f"-- {sum(tried.values())} cases, {rate:.2f}/s, {used / 60:.1f} min, {len(found)} found", flush=True)
    seconds = time.monotonic() - started
    facts = {
        "cases": sum(tried.values()),
        "seconds": round(seconds, 1),
        "processor_seconds": round(used, 1),
        "first_seed": options.seed,
        "commands": {
            name: {"tried": tried[name], "failed": fell[name], "processor_seconds": round(cpu[name], 1)}
            for name in sorted(tried)
        },
        "exit_codes": {str(code): count for code, count in sorted(codes.items())},
        "found": sorted(found),
    }
    print(json.dumps(facts, indent=1))
    if options.out:
        options.out.parent.mkdir(parents=True, exist_ok=True)
        options.out.write_text(json.dumps(facts, indent=1) + "\n")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
