"""Why a plan has each of its steps: what it needs, from which step, and what it makes true, for which step."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from scenewright.cli.explaining.reason import Reason, Reasons, listed, merged
from scenewright.schemas.outside import LARGEST_SETTINGS, file_text
from scenewright.schemas.plan import Plan, PlanFile, PlannedAction
from scenewright.stages.kit.tasks.pddl import parse_domain, parse_problem
from scenewright.stages.kit.tasks.strips import Atom, Domain, GroundAction, Problem, Schema, atom_text, bound

OUTCOME = "outcome"
"""The name under which it is said what became of the plan as a whole."""

STATUS = {
    "executed": "The plan was executed",
    "planned": "A plan was found and not executed",
    "infeasible": "There is no plan",
    "execution_failed": "The plan was executed, and the goal was not reached",
}


def plan_reasons(plan: Plan) -> Reasons:
    """Return the reasons of the outcome, of steps (`step_1`, ...), and of the things that they name."""
    domain_file, problem_file = plan.path("domain.pddl"), plan.path("problem.pddl")
    links: Reasons = {}
    if domain_file.is_file() and problem_file.is_file():
        domain = parse_domain(file_text(domain_file, LARGEST_SETTINGS))
        links = link_reasons(plan.info, domain, parse_problem(file_text(problem_file, LARGEST_SETTINGS), domain))
    return merged(
        [{OUTCOME: list(_outcome(plan.info))}, _steps(plan.info), links, _happened(plan.info), _things(plan.info)]
    )


def link_reasons(plan: PlanFile, domain: Domain, problem: Problem) -> Reasons:
    """Return by step what it needs and what needs it. Steps that the domain does not have get no row."""
    steps = [ground_step(action, plan, domain) for action in plan.actions]
    rows: Reasons = {}
    for number, step in enumerate(steps):
        if step is None:
            continue
        needs = {_text(atom): _source(atom, steps[:number], problem) for atom in sorted(step.preconditions)}
        known: dict[str, list[str]] = {}
        for text, source in needs.items():
            known.setdefault(source, []).append(text)
        makes = {_text(atom): users for atom in sorted(step.add) if (users := _users(atom, number, steps, problem))}
        reasons = [
            Reason(f"It makes {text} true, {users}.", {"makes": text, "for": users}) for text, users in makes.items()
        ]
        if not makes:
            reasons = [Reason("No later step and no goal needs what it makes true.", {"makes": None})]
        if known:
            says = f"It needs {'; '.join(f'{listed(texts)}, {source}' for source, texts in known.items())}."
            reasons.append(Reason(says, {"needs": known}))
        rows[_name(number)] = reasons
    return rows


def ground_step(action: PlannedAction, plan: PlanFile, domain: Domain) -> GroundAction | None:
    """Return the action of the task plan that a step carries out: the one of its name, else the one with its arguments
    under a name that no step has (`take_out` is carried out by `pick`)."""
    arguments = action.arguments
    schemas = {schema.name: schema for schema in domain.schemas}
    own = schemas.get(action.name)
    if own is not None and len(own.parameters) == len(arguments):
        return _bound(own, arguments)
    performed = {step.name for step in plan.actions}
    for tried in plan.tried[-1:]:
        for text in tried.actions:
            name, _, rest = text.partition("(")
            if name not in performed and tuple(rest.removesuffix(")").split(", ")) == arguments and name in schemas:
                return _bound(schemas[name], arguments)
    return None


def _bound(schema: Schema, arguments: tuple[str, ...]) -> GroundAction:
    return bound(schema, dict(zip((name for name, _ in schema.parameters), arguments, strict=True)))


def _source(atom: Atom, before: Sequence[GroundAction | None], problem: Problem) -> str:
    """Return which step made an atom true, or that the problem begins with it."""
    for number in range(len(before) - 1, -1, -1):
        step = before[number]
        if step is not None and atom in step.add:
            return f"made true by {_name(number)}"
    return "true from the start" if atom in problem.initial else "made true by nothing that the plan records"


def _users(atom: Atom, number: int, steps: Sequence[GroundAction | None], problem: Problem) -> str:
    """Return the steps after `number` that need an atom until one changes it, and the goal."""
    users: list[str] = []
    for later in range(number + 1, len(steps)):
        step = steps[later]
        if step is None:
            continue
        if atom in step.preconditions:
            users.append(_name(later))
        if atom in step.add:
            return _need(users) or f"and {_name(later)} makes it true again"
        if atom in step.delete:
            return _need(users)
    return _need([*users, "the goal"] if atom in problem.goal else users)


def _need(users: list[str]) -> str:
    verb = "needs" if len(users) == 1 else "need"
    return f"which {listed(users)} {verb}" if users else ""


def _steps(plan: PlanFile) -> Reasons:
    rows: Reasons = {}
    for number, action in enumerate(plan.actions):
        says = f"Step {number + 1} of {len(plan.actions)}: {action.name}({', '.join(action.arguments)})."
        rows[_name(number)] = [Reason(says, {"name": action.name, "arguments": action.arguments})]
        if number in plan.replanned:
            says = "Something had gone otherwise, so the robot looked around and planned anew before it."
            rows[_name(number)].append(Reason(says, {"replanned": True}))
    return rows


def _happened(plan: PlanFile) -> Reasons:
    rows: Reasons = {}
    for entry in plan.tree_differences:
        says = f"After it {entry.node} was to be {entry.expected}, and was {entry.observed}."
        rows.setdefault(_name(entry.action), []).append(Reason(says, entry.model_dump(mode="json")))
    return rows


def _things(plan: PlanFile) -> Reasons:
    """Return by body or joint what the plan does with it, what it was taken for and which checks name it."""
    rows: Reasons = {}
    named = {name: None for action in plan.actions for name in action.arguments}
    for name in [name for name in named if name != "start"]:
        steps = [_name(k) for k, action in enumerate(plan.actions) if name in action.arguments]
        rows[name] = [Reason(f"The plan names it in {listed(steps)}.", {"steps": steps})]
    for match in plan.matches:
        says = (
            f"In the room of execution it is {match.matched}."
            if match.matched
            else "The room of execution has no such body near it."
        )
        if match.distance is not None:
            says += f" The two boxes lie {1000 * match.distance:.0f} mm apart."
        rows.setdefault(match.body, []).append(Reason(says, match.model_dump(mode="json")))
    for check in plan.checks:
        for name in check.condition.partition("(")[2].removesuffix(")").split(", "):
            if name:
                rows.setdefault(name, []).append(_check(check.condition, check.holds, check.detail))
    for failure in plan.failures:
        for name in dict.fromkeys(failure.objects):
            rows.setdefault(name, []).append(
                Reason(f"{failure.kind}: {failure.message}.", failure.model_dump(mode="json"))
            )
    return rows


def _outcome(plan: PlanFile) -> Iterator[Reason]:
    goal = listed(plan.goal) or "nothing"
    yield Reason(f"The goal is {goal}. {STATUS[plan.status]}.", {"goal": plan.goal, "status": plan.status})
    if len(plan.tried) > 1:
        says = f"Geometry tried {len(plan.tried)} task plans; the last is this one."
        yield Reason(says, {"tried": len(plan.tried)})
    for text in plan.learned:
        yield Reason(f"A failed motion taught: {text}.", {"learned": text})
    for failure in plan.failures:
        yield Reason(f"{failure.kind}: {failure.message}.", failure.model_dump(mode="json"))
    for check in plan.checks:
        yield _check(check.condition, check.holds, check.detail)


def _check(condition: str, holds: bool, detail: str) -> Reason:
    says = f"{condition} {'holds' if holds else 'does not hold'}: {detail}."
    return Reason(says, {"condition": condition, "holds": holds, "detail": detail})


def _text(atom: Atom) -> str:
    return atom_text(atom) if len(atom) > 1 else atom[0]


def _name(number: int) -> str:
    return f"step_{number + 1}"
