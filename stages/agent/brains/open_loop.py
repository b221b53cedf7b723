"""One program for the whole task, written before anything was seen: CaP* (Liang et al. 2023) with the thesis's calls
for exploring and driving. What an execution returns is not looked at."""

from __future__ import annotations

from scenewright.stages.agent.brains.brain import Reply
from scenewright.stages.agent.brains.slips import Slips
from scenewright.stages.agent.brains.words import NotUnderstood, understood
from scenewright.stages.agent.goals import FURNITURE, Among, Description, Gather, Goal, Move, Shut
from scenewright.stages.agent.language.interpreter import Ran

WITH_DOORS = ("fridge", "dresser")


class OpenLoopBrain:
    """Writes the program of a task out of a pattern a goal."""

    label = "open loop rules"

    def __init__(self, words: str, slips: Slips) -> None:
        self._words, self._slips = words, slips

    def reply(self, last: Ran | None) -> Reply:
        """Return the one program."""
        try:
            goals = understood(self._words)
        except NotUnderstood as error:
            return Reply(str(error), f"ask({str(error)!r})")
        mobile = any(_is_mobile(goal) for goal in goals)
        lines = ["rooms = explore_global()" if mobile else "objects = explore_local()"]
        for number, goal in enumerate(goals):
            lines += _program(goal, number, mobile)
        slipped = [self._slips.written(line, key) for key, line in enumerate(lines)]
        return Reply("Do all of it.", "\n".join([*slipped, "done()"]))


def _is_mobile(goal: Goal) -> bool:
    match goal:
        case Move(onto=onto, start=start):
            return bool(start) or onto.labels[0] in FURNITURE
        case Among():
            return False
    return True


def _program(goal: Goal, number: int, mobile: bool) -> list[str]:
    match goal:
        case Shut(what=what, opened=opened):
            furniture_code = f"rooms.find({what.labels[0]!r})[0]"
            return [f"navigate({furniture_code})", f"{'open' if opened else 'close'}({furniture_code})"]
        case Among(what=what, around=around):
            return _each(what, [f"place_among(objects.find({around.labels[0]!r})[0])"], f"moved_{number}")
        case Gather(what=what, onto=onto):
            target = f"rooms.find({onto.labels[0]!r})[0]"
            put = [f"navigate({target})", f"place({target})", "navigate(spot)"]
            inner = ["navigate(spot)", "objects = explore_local()", *_each(what, put)]
            return [f"for spot in rooms.find({onto.labels[0]!r}):", f"    if spot != {target}:", *_indent(inner, 2)]
        case Move():
            return _move(goal, number, mobile)


def _move(goal: Move, number: int, mobile: bool) -> list[str]:
    onto, flag = goal.onto.labels[0], "" if goal.every else f"moved_{number}"
    if not mobile:
        return _each(goal.what, [f"place(objects.find({onto!r})[0])"], flag)
    start = goal.start or "table"
    target = home = f"rooms.find({onto!r})[0]"
    lines = []
    if onto not in FURNITURE:
        target, home = f"carrier_{number}", f"home_{number}"
        remembering_lines = [f"{target} = objects.find({onto!r})[0]", f"{home} = spot"]
        lines = ["for spot in rooms.find('table'):", "    navigate(spot)", "    objects = explore_local()"]
        lines += [f"    if objects.find({onto!r}):", *_indent(remembering_lines, 2)]
    put = [f"navigate({home})", f"place({target})", *(["navigate(spot)"] if goal.every else [])]
    inner = ["navigate(spot)", *(["open(spot)"] if start in WITH_DOORS else []), "objects = explore_local()"]
    loop = [f"for spot in rooms.find({start!r}):", *_indent([*inner, *_each(goal.what, put)], 1)]
    if flag:
        once = _each(goal.what, put, flag)
        loop = [once[0], loop[0], f"    if not {flag}:", *_indent([*inner, *once[1:]], 2)]
    return [*lines, *loop]


def _each(what: Description, put: list[str], flag: str = "") -> list[str]:
    """Return loops over what is found: grasp it and put it away; with a flag only the first."""
    color = f", {what.color!r}" if what.color else ""
    body = ["grasp(item)", *put]
    if flag:
        body = [f"if not {flag}:", *_indent([*body, f"{flag} = 1"], 1)]
    lines = [f"{flag} = 0"] if flag else []
    for label in what.labels:
        lines += [f"for item in objects.find({label!r}{color}):", *_indent(body, 1)]
    return lines


def _indent(lines: list[str], levels: int) -> list[str]:
    return ["    " * levels + line for line in lines]
