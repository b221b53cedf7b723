"""Whether a command stood: its exit code, its words, its inputs, and what it left."""

from __future__ import annotations

import re
import shutil
from dataclasses import dataclass
from pathlib import Path

from scenewright.schemas.errors import ScenewrightError
from scenewright.schemas.manifest import MANIFEST_NAME
from scenewright.stages.engine.reading import check_hashes, open_artifact

from tests.fuzz.commands import forking
from tests.fuzz.commands.case import Case
from tests.fuzz.commands.workspace import OUT, prepare, stamps_of, whole_copy

CODES = (0, 2, 3, 4, 5)
"""What a command may end with: nothing here is the machine's fault (6), nobody interrupts (130)."""
FRAME = re.compile(r'File "[^"]*/((?:stages|schemas|cli)/[^"]+)", line (\d+), in (\S+)')
RAISED = re.compile(r"^([A-Za-z_][\w.]*(?:Error|Exception|Interrupt|Warning|Failure|Exit)\b[^\n]*)", re.MULTILINE)


@dataclass(frozen=True)
class Verdict:
    """What came of a case; `reason` is empty where the command stood."""

    reason: str
    place: str = ""
    """Where in the program, for telling finds apart."""
    said: str = ""
    code: int = 0
    cpu_seconds: float = 0.0
    memory_bytes: int = 0

    @property
    def name(self) -> str:
        """What finds of the same kind have in common."""
        return f"{self.reason}: {self.place}" if self.reason else ""


def judge(case: Case, base: Path, root: Path, base_stamps: dict[str, tuple[int, int, int]] | None = None) -> Verdict:
    """Run a case under `root`, which is emptied first."""
    shutil.rmtree(root, ignore_errors=True)
    root.mkdir(parents=True)
    words = prepare(case, base, root)
    before = stamps_of([root / "in"])
    limit = forking.LONG_CPU_SECONDS if case.long else forking.CPU_SECONDS
    ended = forking.run(words, root / "cwd", root / "scratch", limit)
    reason = _fault(case, ended)
    touched = stamps_of([root / "in"]) != before or (base_stamps is not None and stamps_of([base]) != base_stamps)
    if not reason and not whole_copy(case) and touched:
        reason = "changed an input"
    if not reason:
        reason = _left(case, ended, root)
    place = ""
    if reason.startswith(("exit", "signal", "traceback", "said")) and "--debug" not in words:
        shutil.rmtree(root / OUT, ignore_errors=True)
        again = forking.run([*words, "--debug"], root / "cwd", root / "scratch")
        place = where(again.error)
    elif reason:
        place = case.command
    return Verdict(reason, place, ended.error[-1500:], ended.code, ended.cpu_seconds, ended.memory_bytes)


def _fault(case: Case, ended: forking.Ended) -> str:
    if ended.hung:
        return "" if case.long else "does not end"
    if ended.code < 0:
        return f"signal {-ended.code}"
    if ended.memory_bytes > forking.MEMORY_BYTES and not case.long:
        return "memory"
    if "Traceback" in ended.error or "internal error" in ended.error:
        return f"traceback, exit {ended.code}" if ended.code != 1 else "exit 1"
    too_long = ended.code == 6 and "File name too long" in ended.error
    if ended.code not in CODES and not (case.long and ended.code == 6) and not too_long:
        return f"exit {ended.code}"
    if "\x1b" in ended.error + ended.output:
        return "said an escape sequence"
    errors = sum(line.startswith("error:") for line in ended.error.splitlines())
    if ended.code in (2, 3, 5, 6) and errors != 1 and not (case.words[0] == "urdf-check" and ended.output):
        return f"said {errors} lines of error"
    return ""


def _left(case: Case, ended: forking.Ended, root: Path) -> str:
    """Say what is wrong with what stands there afterwards."""
    if any((root / "cwd").iterdir()):
        return "wrote into the current folder"
    strange = [path.name for path in root.glob(".*") if not path.name.endswith(".lock")]
    if strange and not ended.hung:
        return "left a partial folder"
    out = root / OUT
    if not (out / MANIFEST_NAME).is_file():
        written = any(path.is_file() for path in out.glob("*.json"))
        return "half an artifact" if written and case.words[0] not in _FREE else ""
    try:
        artifact = open_artifact(out)
        assert artifact.manifest is not None
        check_hashes(out, artifact.manifest)
        if artifact.outcome == "ok":
            for name, model in artifact.json_files.items():
                model.read(artifact.path(name))
    except ScenewrightError:
        return "half an artifact"
    if ended.code not in (0, 4) and not ended.hung:
        return f"an artifact in spite of exit {ended.code}"
    return ""


_FREE = ("schemas", "run", "batch", "export")
"""Commands whose output is no artifact, or holds one for each step."""


def where(error: str) -> str:
    """Return the exception of a traceback and the deepest function of ours."""
    frames = FRAME.findall(error)
    raised = RAISED.findall(error)
    place = f"{frames[-1][0]} {frames[-1][2]}" if frames else "?"
    return f"{(raised[-1].split(':')[0] if raised else 'crash')} at {place}"
