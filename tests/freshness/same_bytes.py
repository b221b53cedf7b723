"""Evidence that a change of code changes no bytes: the step's small runs, by the code as it was and as it is, on this
machine and on the same inputs. No digest is kept in a file, as other machines round differently.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

from scenewright.stages.kit.stage import Stage

from tests.freshness.program import Program
from tests.freshness.records import REPOSITORY, Record, code_of, path_of
from tests.freshness.runs import RUNS, Run

KEPT = ("stages", "schemas", "cli", "data", "pyproject.toml", "requirements.lock")
"""What a checkout needs to run steps."""
BY_NAME = {run.name: run for run in RUNS}


class Refused(Exception):
    """The bytes differ, or nobody can tell."""


class Evidence:
    """Runs steps by old and new code below `folder`; what the old code made is kept for the next step."""

    def __init__(self, folder: Path, since: str | None = None) -> None:
        self._folder, self._since = folder, since

    def same_bytes(self, stage: Stage, record: Record) -> str:
        """Return in words what was the same. Raises Refused when something was not, or cannot be run."""
        runs = [run for run in RUNS if run.step == stage.name]
        if not runs:
            raise Refused(f"{stage.name} has no run in tests/freshness/runs.py: add one, or say why with --because")
        commit, old = self._code_recorded(stage, record)
        for run in runs:
            before = self._made(run, old)
            after = self._run(run, REPOSITORY, self._folder / "now" / run.name, old)
            if _digest(before) != _digest(after):
                files = _files(before).items() ^ _files(after).items()
                changed = ", ".join(sorted({name for name, _ in files}))
                raise Refused(f"{stage.name} {run.options}: other bytes than at {commit}, in {changed}")
        return f"same bytes as at {commit}: " + "; ".join(f"{run.step} {run.options}".strip() for run in runs)

    def _code_recorded(self, stage: Stage, record: Record) -> tuple[str, Path]:
        """Return the commit whose code was recorded, and a checkout of it. Raises Refused when it cannot be found."""
        path = path_of(stage.name).relative_to(REPOSITORY)
        named = [self._since] if self._since else ["HEAD", *_git("rev-list", "-20", "HEAD", "--", str(path)).split()]
        for name in named:
            commit = _git("rev-parse", "--short=10", name).strip()
            tree = self._checkout(commit)
            try:
                if code_of(Program(tree), stage).digest == record.code:
                    return commit, tree
            except (KeyError, AssertionError):  # the step did not exist, or was called otherwise
                continue
        raise Refused(f"{stage.name}: the code that was recorded is not that of {' or '.join(named)}: --since COMMIT")

    def _checkout(self, commit: str) -> Path:
        tree = self._folder / commit
        if not tree.exists():
            tree.mkdir(parents=True)
            archive = subprocess.run(
                ["git", "archive", commit, *KEPT], cwd=REPOSITORY, capture_output=True, check=True
            ).stdout
            subprocess.run(["tar", "-x", "-C", str(tree)], input=archive, check=True)
        return tree

    def _made(self, run: Run, tree: Path) -> Path:
        """Make a run and what it needs by the code of `tree`, unless that is done."""
        out = self._folder / f"made_{tree.name}" / run.name
        if not (out / "manifest.json").exists():
            for name in run.needs():
                self._made(BY_NAME[name], tree)
            self._run(run, tree, out, tree)
        return out

    def _run(self, run: Run, code: Path, out: Path, inputs: Path) -> Path:
        """Carry out a run by the code of one checkout on what that of another made. Raises Refused when it fails."""
        made = self._folder / f"made_{inputs.name}"
        words = [str(made / word[1:]) if word.startswith("@") else word for word in run.options.split()]
        # numba's own caches do not notice that a callee in another file changed.
        settings = {"OMP_NUM_THREADS": "1", "NUMBA_CACHE_DIR": str(self._folder / f"numba_{code.name}")}
        done = subprocess.run(
            [sys.executable, "-m", "scenewright", *run.step.split(), *words, "--out", str(out), "--quiet"],
            cwd=code,
            env={**os.environ, **settings},
            capture_output=True,
            text=True,
        )
        if done.returncode not in (0, 4):
            raise Refused(f"{run.step} {run.options} ({code.name}): {done.stderr.strip() or done.returncode}")
        return out


def _git(*words: str) -> str:
    done = subprocess.run(["git", *words], cwd=REPOSITORY, capture_output=True, text=True)
    if done.returncode:
        raise Refused(f"git {' '.join(words)}: {done.stderr.strip()}")
    return done.stdout


def _digest(artifact: Path) -> str:
    return json.loads((artifact / "manifest.json").read_text())["content_digest"]


def _files(artifact: Path) -> dict[str, str]:
    files = json.loads((artifact / "manifest.json").read_text())["files"]
    return {file["path"]: file["sha256"] for file in files if file["digested"]}
