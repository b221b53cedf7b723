"""The method that is measured: a checkout, this one or an older one, whose commands are run as a user runs them."""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from scenewright.schemas.errors import BadInput, MachineFailure, UsageError
from scenewright.stages.engine.interruption import PARENT_VARIABLE

REPOSITORY = Path(__file__).resolve().parents[2]
STEPS = ("poses", "segment", "fuse", "graph", "cad", "urdf", "plan")
"""What the digest of a method covers; the generator of the rooms is no part of it."""
EMPTY = 4
"""Exit code of a step whose artifact was written with another outcome than `ok`."""
NOT_OF_THE_METHOD = (2, 5, 6, 130)
"""Exit codes of a command that was not understood, lacks a library, met a full or busy machine, or was interrupted."""
ASK_FOR_DIGESTS = (
    "import sys; from scenewright.stages.engine.code.digests import step_code; "
    "from scenewright.stages.engine.discovery import stage_by_name; "
    "print(*(step_code(stage_by_name(name)).digest for name in sys.argv[1:]))"
)


class MethodFailed(BadInput):
    """A command of the method ended with this exit code: a result of the method, not a fault of the board."""

    def __init__(self, command: str, code: int, said: str) -> None:
        super().__init__(f"{command} ended with {code}: {said}", hint="run the command by itself")
        self.command, self.exit_code = command, code


@dataclass(frozen=True)
class Method:
    """A checkout whose commands are measured."""

    checkout: Path = REPOSITORY

    def run(self, command: str, out: Path, *words: object) -> float:
        """Run a command that writes `out`; return its processor seconds, 0 where it was up to date already.

        An artifact without content is a result too. Raises MethodFailed with the last line that the command said,
        MachineFailure where that is no fault of the method.
        """
        before = (out / "manifest.json").stat().st_mtime_ns if (out / "manifest.json").is_file() else 0
        full = [*self._program(), *command.split(), *map(str, words), "--out", str(out), "--quiet"]
        start = os.times()
        done = subprocess.run(full, env=self._environment(), capture_output=True, text=True, check=False)
        spent = os.times()
        if done.returncode not in (0, EMPTY):
            said = (done.stderr.strip() or done.stdout.strip() or "nothing was said").splitlines()[-1]
            if done.returncode in NOT_OF_THE_METHOD or done.returncode < 0:
                raise MachineFailure(f"{command} ended with {done.returncode}: {said}", hint="measure it again")
            raise MethodFailed(command, done.returncode, said)
        seconds = spent.children_user + spent.children_system - start.children_user - start.children_system
        return round(seconds, 2) if (out / "manifest.json").stat().st_mtime_ns != before else 0.0

    def _program(self) -> list[str]:
        named = (self.checkout / "scenewright" / "__main__.py").is_file()
        return [sys.executable, "-P", "-m", "scenewright" if named else "cli"]

    def _environment(self) -> dict[str, str]:
        return {**os.environ, "PYTHONPATH": str(self.checkout), PARENT_VARIABLE: str(os.getpid())}

    @cached_property
    def commit(self) -> str:
        """The commit of the checkout, ten digits."""
        return self._git("rev-parse", "--short=10", "HEAD")

    @cached_property
    def committed(self) -> str:
        """When the commit of the checkout was made."""
        return self._git("show", "--no-patch", "--format=%cI", "HEAD")

    @cached_property
    def clean(self) -> bool:
        """Whether the files that git knows, and new ones of the method, are those of the commit."""
        return not self._git("status", "--porcelain", "--", "stages", "schemas", "cli", "scenewright", "benchmarks")

    @cached_property
    def digest(self) -> str:
        """Sixteen digits that change with any line that `STEPS` reach, and with what they take by default.

        A checkout that cannot tell it (before the code was in the key) is known by its files.
        """
        if (self.checkout / "stages" / "engine" / "code").is_dir():
            asked = [sys.executable, "-P", "-c", ASK_FOR_DIGESTS, *STEPS]
            said = subprocess.run(asked, env=self._environment(), capture_output=True, text=True, check=False)
            if said.returncode:
                raise UsageError(f"{self.checkout}: no digest of its steps", hint=said.stderr.strip()[-300:])
            facts = said.stdout
        else:
            if not self.clean:
                raise UsageError(f"{self.checkout} holds uncommitted changes", hint="commit them: it is known by files")
            facts = self._git("rev-parse", "HEAD:stages", "HEAD:schemas", "HEAD:data")
        return hashlib.sha256(facts.encode()).hexdigest()[:16]

    def _git(self, *words: str) -> str:
        done = subprocess.run(["git", "-C", self.checkout, *words], capture_output=True, text=True, check=False)
        if done.returncode:
            raise UsageError(f"{self.checkout} is no checkout of git", hint="clone the project with its history")
        return done.stdout.strip()


def checkout_of(commit: str, folder: Path) -> Path:
    """Return a worktree of a commit below `folder`, made where it is missing. Raises UsageError without that commit."""
    path = folder / commit
    if not (path / "pyproject.toml").is_file():
        words = ["git", "-C", str(REPOSITORY), "worktree", "add", "--force", "--detach", str(path), commit]
        done = subprocess.run(words, capture_output=True, text=True, check=False)
        if done.returncode:
            hint = "clone the project with its history: git fetch --unshallow"
            raise UsageError(f"no commit {commit} here: {done.stderr.strip()[-200:]}", hint=hint)
    return path
