"""Fast Downward (Helmert 2006) as a program of its own: PDDL in files, a plan out of a file, validated before use.

It is GPL-licensed: the package `up-fast-downward` (extra `planning-gpl`) carries the built planner, is never imported
and only called through its driver. Nothing that it answers is trusted: a plan is read as names, looked up among our own
ground actions and run by our own validator.
"""

from __future__ import annotations

import importlib.util
import subprocess
import sys
import tempfile
from dataclasses import replace
from pathlib import Path

from scenewright.schemas.errors import BadInput, MissingDependency
from scenewright.stages.kit.tasks.pddl import domain_text, problem_text
from scenewright.stages.kit.tasks.strips import Atom, Domain, GroundAction, Problem, validate
from scenewright.stages.kit.tasks.task_planner import TaskPlan

PACKAGE = "up_fast_downward"
ALIAS = "lama-first"
UNSOLVABLE = (10, 11, 12)
"""Exit codes of Fast Downward for tasks without a plan."""
LONGEST = 60.0
"""Time after which the planner is stopped [s]: a guard against a hang, not a budget."""
INSTEAD = "take --planner builtin"


def driver() -> Path:
    """Return the path of the planner's driver. Raises MissingDependency."""
    spec = importlib.util.find_spec(PACKAGE)
    folders = list(spec.submodule_search_locations or ()) if spec is not None else []
    for folder in folders:
        path = Path(folder) / "downward" / "fast-downward.py"
        if path.is_file():
            return path
    raise MissingDependency(
        "Fast Downward is not installed", hint="pip install 'scenewright[planning-gpl]', or take --planner builtin"
    )


def plan_with_fast_downward(domain: Domain, problem: Problem, actions: list[GroundAction]) -> TaskPlan:
    """Return a plan for a STRIPS problem without negation that uses only `actions`, ground actions of the domain.

    Raises MissingDependency without the planner, BadInput when its answer is no plan. Its states are not counted.
    """
    program = driver()
    task_domain, task_problem, names = _restrict(domain, problem, actions)
    with tempfile.TemporaryDirectory() as folder:
        files = [Path(folder) / name for name in ("domain.pddl", "problem.pddl", "plan")]
        files[0].write_text(domain_text(task_domain), encoding="utf-8")
        files[1].write_text(problem_text(task_problem, task_domain.name), encoding="utf-8")
        command = [sys.executable, str(program), "--plan-file", str(files[2]), "--alias", ALIAS, *map(str, files[:2])]
        try:
            done = subprocess.run(command, cwd=folder, capture_output=True, timeout=LONGEST, check=False)
        except subprocess.TimeoutExpired:
            return TaskPlan(None, 0, False)
        if done.returncode in UNSOLVABLE:
            return TaskPlan(None, 0, True)
        if done.returncode != 0 or not files[2].is_file():
            tail = done.stderr.decode(errors="replace").strip().splitlines()[-1:] or ["no output"]
            raise BadInput(f"Fast Downward ended with {done.returncode}: {tail[0][:200]}", hint=INSTEAD)
        text = files[2].read_text(encoding="utf-8", errors="replace")
    plan = read_plan(text, names)
    try:
        validate(problem, plan)
    except ValueError as error:
        raise BadInput(f"Fast Downward's plan does not hold: {error}", hint=INSTEAD) from None
    return TaskPlan(plan, 0, False)


def read_plan(text: str, actions: dict[str, GroundAction]) -> list[GroundAction]:
    """Return the actions that the lines `(name object ...)` of a plan file name; comment lines begin with `;`.

    `actions` are by such a line, without the brackets. Raises BadInput for a line that names none of them.
    """
    plan = []
    for number, line in enumerate(text.splitlines(), start=1):
        step = " ".join(line.lower().replace("(", " ( ").replace(")", " ) ").split())
        if not step or step.startswith(";"):
            continue
        inner = step.removeprefix("( ").removesuffix(" )")
        if step != f"( {inner} )" or inner not in actions:
            raise BadInput(f"plan, line {number}: {line.strip()[:60]!r} is not an action of the task", hint=INSTEAD)
        plan.append(actions[inner])
    return plan


def _restrict(
    domain: Domain, problem: Problem, actions: list[GroundAction]
) -> tuple[Domain, Problem, dict[str, GroundAction]]:
    """Return domain and problem in which only `actions` can be done, objects as `o<k>`, and the action of each line.

    Every schema asks for `may-<schema>` of its arguments, which holds initially for the ground actions given.
    """
    objects = {name: f"o{number}" for number, name in enumerate(sorted(problem.objects))}

    def renamed(atoms: frozenset[Atom]) -> frozenset[Atom]:
        return frozenset((atom[0], *(objects[term] for term in atom[1:])) for atom in atoms)

    may = {schema.name: (f"may-{schema.name}", *(name for name, _ in schema.parameters)) for schema in domain.schemas}
    schemas = tuple(
        replace(schema, preconditions=(*schema.preconditions, may[schema.name])) for schema in domain.schemas
    )
    predicates = {f"may-{schema.name}": tuple(kind for _, kind in schema.parameters) for schema in domain.schemas}
    allowed = frozenset((f"may-{action.name}", *action.arguments) for action in actions)
    task = Problem(
        "task",
        {objects[name]: kind for name, kind in problem.objects.items()},
        renamed(problem.initial | allowed),
        renamed(problem.goal),
    )
    lines = {" ".join((action.name, *(objects[term] for term in action.arguments))): action for action in actions}
    return replace(domain, predicates={**domain.predicates, **predicates}, schemas=schemas), task, lines
