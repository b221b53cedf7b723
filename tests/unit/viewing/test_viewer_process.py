"""The window of `view` listens on this machine alone."""

from __future__ import annotations

import socket
import subprocess
import sys
from typing import Any

import pytest
from scenewright.cli.viewing import viewer_process
from scenewright.schemas.errors import MachineFailure


class Started:
    """What stands for a viewer: a process that is there, or has ended."""

    def __init__(self, ended: bool) -> None:
        self.ended = ended

    def poll(self) -> int | None:
        return 1 if self.ended else None


def free_port() -> int:
    with socket.socket() as some:
        some.bind(("127.0.0.1", 0))
        return int(some.getsockname()[1])


def test_a_viewer_is_started_for_this_machine_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    port = free_port()
    started: list[list[str]] = []
    with socket.socket() as listener:

        def start(command: list[str], **_: Any) -> Started:
            started.append(command)
            listener.bind(("127.0.0.1", port))
            listener.listen()
            return Started(ended=False)

        monkeypatch.setattr(subprocess, "Popen", start)
        for _ in range(2):  # the second time it is there
            assert viewer_process.viewer_address(port) == f"rerun+http://127.0.0.1:{port}/proxy"
    (command,) = started
    assert command[0] == sys.executable and command[command.index("--bind") + 1] == "127.0.0.1"


def test_a_viewer_that_does_not_start(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(subprocess, "Popen", lambda *_, **__: Started(ended=True))
    with pytest.raises(MachineFailure, match="did not start"):
        viewer_process.viewer_address(free_port())
