"""`scenewright predicates show`: what was learned, in words."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from scenewright.cli.output import out


def show(
    folder: Annotated[Path, typer.Argument(help="learned_domain artifact.")],
    predicate: Annotated[str, typer.Option("--predicate", help="One predicate, with every example behind it.")] = "",
    json_output: Annotated[bool, typer.Option("--json", help="domain.json as one JSON object.")] = False,
    debug: Annotated[bool, typer.Option("--debug", help="Show the traceback of an error.")] = False,
) -> int:
    """Say what each predicate means and was learned of, the operators, goals, and what is no longer believed."""
    from scenewright.schemas.learned_domain import LearnedDomain
    from scenewright.schemas.outside import LARGEST_SETTINGS, file_text
    from scenewright.stages.engine.reading import open_artifact
    from scenewright.stages.kit.tasks.pddl import parse_domain
    from scenewright.stages.predicates.language.showing import domain_lines, example_lines
    from scenewright.stages.predicates.learning.records import memory_of

    learned = open_artifact(folder, LearnedDomain)
    assert isinstance(learned, LearnedDomain)
    memory_of(learned.info, str(learned.root))  # refuses what refers to nothing
    if json_output:
        out(learned.info.model_dump_json())
        return 0
    if predicate:
        lines = example_lines(learned.info, predicate)
    else:
        lines = domain_lines(learned.info, parse_domain(file_text(learned.path("domain.pddl"), LARGEST_SETTINGS)))
    for line in lines:
        out(line)
    return 0
