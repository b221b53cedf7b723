"""Steps of `run` in forks of it: what they share, and when it is loaded."""

from __future__ import annotations

import subprocess
import sys

PROGRAM = """
import sys
from scenewright.stages.engine import forking
forking.AT_WORK = 1.0
child = [sys.executable, "-m", "tests.unit.housekeeping.forked_child"]
with forking.begun(["json", "json", "no.such.module", "colorsys"]):
    assert forking.forks()
    print([forking.run_forked([*child, seconds], {}) for seconds in ("0", "2", "0", "0")])
print(forking.forks())
"""


def test_code_is_loaded_ahead_while_a_step_works_and_not_for_one_that_is_up_to_date() -> None:
    done = subprocess.run([sys.executable, "-c", PROGRAM], capture_output=True, text=True, check=True)
    assert (
        done.stdout == "[(3, 'False\\n'), (3, 'False\\n'), (3, 'True\\n'), (3, 'True\\n')]\nFalse\n"
        and done.stderr == ""
    )
