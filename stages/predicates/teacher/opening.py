"""Which teacher: simulated, or a person."""

from __future__ import annotations

import sys
from pathlib import Path

from scenewright.schemas.errors import UsageError
from scenewright.stages.predicates.parameters import TeachParameters
from scenewright.stages.predicates.teacher.simulated import SimulatedTeacher, Teacher, TeacherLeft
from scenewright.stages.predicates.teacher.terminal import TerminalTeacher, read_dialogue


def open_teacher(parameters: TeachParameters, domain: str, seed: int, dialogue: Path | None, log: Path) -> Teacher:
    """Return the teacher; a person's answers go to `log`. Raises UsageError without a terminal and a dialogue."""
    if parameters.teacher == "simulated":
        if dialogue is not None:
            raise UsageError("--dialogue is what a person said", hint="did you mean --teacher terminal?")
        return SimulatedTeacher(domain, seed, parameters.wording, parameters.wrong)
    earlier = read_dialogue(dialogue) if dialogue is not None else []
    at_terminal = sys.stdin is not None and sys.stdin.isatty()
    if not at_terminal and not earlier:
        raise UsageError("--teacher terminal: there is no terminal to ask in", hint="or give --dialogue teacher.jsonl")
    return TerminalTeacher(domain, earlier, log, _in_terminal if at_terminal else None)


def _in_terminal(question: str) -> str:
    """Ask on standard error, as standard output is for data. Raises TeacherLeft at the end of input (Ctrl-D)."""
    sys.stderr.write(f"{question}\n> ")
    sys.stderr.flush()
    line = sys.stdin.readline()
    if not line:
        raise TeacherLeft
    return line.strip()
