"""A chain that is killed takes its step with it: the next run can begin at once, and ends as if nothing had been."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from scenewright.stages.engine import interruption, store

from tests.reliability.running import REPOSITORY

PIPELINE = """
name = "library"
summary = "One step"
[[step]]
name = "cad_library"
stage = "library build"
seed = 1
"""


def children_of(parent: int) -> list[int]:
    tasks = Path(f"/proc/{parent}/task/{parent}/children")
    return [int(word) for word in tasks.read_text().split()] if tasks.exists() else []


def is_running(process: int) -> bool:
    try:
        return Path(f"/proc/{process}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except (FileNotFoundError, ProcessLookupError):
        return False


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="needs /proc and parent death signals")
@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM, signal.SIGINT])
def test_the_step_ends_with_its_chain(tmp_path: Path, number: signal.Signals) -> None:
    (tmp_path / "p.toml").write_text(PIPELINE)
    command = [sys.executable, "-m", "scenewright", "run", str(tmp_path / "p.toml"), "--out", str(tmp_path / "run")]
    chain = subprocess.Popen(command, cwd=REPOSITORY, text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    deadline = time.monotonic() + 60
    while not list((tmp_path / "run").glob(".cad_library.partial-*")) and time.monotonic() < deadline:
        time.sleep(0.01)
    steps = children_of(chain.pid)
    assert steps
    os.kill(chain.pid, number)
    chain.communicate(timeout=60)
    assert chain.returncode == (130 if number != signal.SIGKILL else -9)
    deadline = time.monotonic() + 20
    while any(map(is_running, steps)) and time.monotonic() < deadline:
        time.sleep(0.01)
    assert not any(map(is_running, steps))
    assert [path.name for path in (tmp_path / "run").iterdir()] == [".cad_library.lock"]
    with store.locked(tmp_path / "run" / "cad_library"):  # what the next run does first
        pass


def test_a_step_whose_chain_is_gone_does_not_begin(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(interruption.ctypes, "CDLL", lambda name: type("Library", (), {"prctl": lambda *a: 0})())
    monkeypatch.setenv(interruption.PARENT_VARIABLE, str(os.getppid() + 1))
    with pytest.raises(KeyboardInterrupt):
        interruption.end_with_parent()
    assert interruption.PARENT_VARIABLE not in os.environ  # grandchildren are not its business
    monkeypatch.setenv(interruption.PARENT_VARIABLE, str(os.getppid()))
    interruption.end_with_parent()
    monkeypatch.setenv(interruption.PARENT_VARIABLE, "not a number")
    interruption.end_with_parent()


HALF_MADE = """
import os, signal
from scenewright.stages.engine import interruption

class HalfMade:
    def __del__(self):
        self.handle.close()

interruption.install()
if {interrupted}:
    try:
        os.kill(os.getpid(), signal.SIGTERM)
    except KeyboardInterrupt:
        pass
HalfMade()
"""


@pytest.mark.parametrize("interrupted", [True, False])
def test_a_finalizer_of_what_an_interruption_left_half_made_is_silent(interrupted: bool) -> None:
    command = [sys.executable, "-c", HALF_MADE.format(interrupted=interrupted)]
    said = subprocess.run(command, capture_output=True, text=True, check=True).stderr
    assert ("AttributeError" in said) != interrupted
