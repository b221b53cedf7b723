"""`scenewright ask`: where a thing is, where one can be put, what serves a purpose."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer
from scenewright.cli.output import out, say

NOTHING = 4
"""Exit code where the scene has no answer."""


def ask(
    scene: Annotated[Path, typer.Argument(help="Map, contact graph, CAD scene or interactive scene.")],
    question: Annotated[str, typer.Argument(help='"where can I put the cup?", "red mug on the desk", ...')] = "",
    what: Annotated[bool, typer.Option("--what", help="List what can be asked for.")] = False,
    robot: Annotated[str, typer.Option(help="Robot that has to get to places: of data/robots/, or a TOML file.")] = "",
    json_output: Annotated[bool, typer.Option("--json", help="One JSON object on standard output.")] = False,
    debug: Annotated[bool, typer.Option("--debug", help="Show the traceback of an error.")] = False,
) -> int:
    """Answer a question in words about the things of a scene and places on them."""
    from scenewright.cli.asking.answering import answer, can_be_asked
    from scenewright.cli.asking.asked_scene import AskedScene
    from scenewright.stages.engine.reading import open_artifact
    from scenewright.stages.kit.open_words.reading.meaning import Meanings
    from scenewright.stages.kit.open_words.reading.phrase import read_phrase

    phrase = None if what else read_phrase(question)
    asked = AskedScene(open_artifact(scene))
    meanings = Meanings()
    if phrase is None:
        lines = can_be_asked(asked, meanings)
        out(json.dumps({"scene": str(scene), "can_be_asked": lines}) if json_output else "\n".join(lines))
        return 0
    told = answer(asked, phrase, meanings, robot)
    if json_output:
        out(json.dumps({"scene": str(scene), "question": question, **vars(told)}, sort_keys=True))
    else:
        say(told.understood)
        out("\n".join(told.lines))
    return 0 if told.things or told.places else NOTHING
