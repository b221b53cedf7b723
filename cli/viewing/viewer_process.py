"""A Rerun viewer that listens on this machine alone.

Rerun's own `spawn` starts one that listens on every address of the machine, and has no way to say otherwise.
"""

from __future__ import annotations

import socket
import subprocess
import sys
import time

from scenewright.schemas.errors import MachineFailure

HOST, PORT = "127.0.0.1", 9876
"""Address of the viewer: this machine, and Rerun's own port."""
LONGEST_START = 20.0
"""Seconds until the window has to be there."""


def viewer_address(port: int = PORT) -> str:
    """Return where a viewer listens, starting one when none does. Raises MachineFailure when it does not come up."""
    address = f"rerun+http://{HOST}:{port}/proxy"
    if _answers(port):  # a window that is open already
        return address
    process = subprocess.Popen(
        [sys.executable, "-m", "rerun_cli", "--bind", HOST, "--port", str(port), "--expect-data-soon"],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        start_new_session=True,  # it outlives us
    )
    deadline = time.monotonic() + LONGEST_START
    while time.monotonic() < deadline:
        if _answers(port):
            return address
        if process.poll() is not None:
            break
        time.sleep(0.05)
    raise MachineFailure("the Rerun viewer did not start", hint="--save FILE.rrd writes a file to open elsewhere")


def _answers(port: int) -> bool:
    try:
        with socket.create_connection((HOST, port), timeout=1.0):
            return True
    except OSError:
        return False
