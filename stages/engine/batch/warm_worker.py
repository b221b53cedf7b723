"""A process that runs scenes in forks of itself; warm.py starts it by the name of this module.

It reads a request a line (job and host) from standard input and answers with a line: the scene's result, or null for
one that was stopped. Scenes are processes of their own in groups of their own, watched and limited as ever
(scene_run.py); what differs is that they begin with the libraries that scenes before them had to load. SIGTERM stops
the running scene; the end of standard input ends the worker. It has one thread, so that forking is safe.
"""

from __future__ import annotations

import json
import os
import signal
import sys
import tempfile
from types import FrameType

from scenewright.stages.engine import forking
from scenewright.stages.engine.batch.job import Job
from scenewright.stages.engine.batch.scene_run import run_processes, start_scene
from scenewright.stages.engine.interruption import PARENT_VARIABLE


class _Asked:
    """Whether the running scene is to be stopped. No lock: a signal handler sets it."""

    stop = False

    def __call__(self) -> bool:
        return self.stop

    def interrupt(self, number: int, frame: FrameType | None) -> None:
        self.stop = True


def main() -> None:
    """Answer requests until there are no more."""
    interruption = _Asked()
    signal.signal(signal.SIGTERM, interruption.interrupt)
    answers = os.dup(1)
    os.dup2(2, 1)  # what libraries print when they are loaded is no answer
    with tempfile.TemporaryFile("a+b", buffering=0) as learned:
        forking.begin(learned)
        _answer_all(answers, interruption)


def _answer_all(answers: int, interruption: _Asked) -> None:
    def start(job: Job, log: int) -> forking.Process:
        if forking.module_words(job.command) is None:
            return start_scene(job, log)
        parent = {PARENT_VARIABLE: str(os.getpid())}
        return forking.ForkedProcess(job.command, log, parent, closed=(answers,))

    for line in sys.stdin:
        request = json.loads(line)
        interruption.stop = False
        result = run_processes(Job.model_validate(request["job"]), interruption, request["host"], start)
        os.write(answers, (b"null" if result is None else result.model_dump_json().encode()) + b"\n")
        forking.load_learned()


if __name__ == "__main__":
    main()
