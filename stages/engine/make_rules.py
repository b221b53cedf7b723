"""A makefile generated from a pipeline: a target is a manifest, its prerequisites are the manifests it reads.

make may run a command too often (it goes by times); the key decides whether there is work.
"""

from __future__ import annotations

import re

from scenewright.stages.engine.given_inputs import given_inputs
from scenewright.stages.engine.pipelines import Pipeline, Step, step_arguments

_VARIABLE = re.compile(r"^\$([a-z_]+)$")


def _recipe(step: Step, pipeline: Pipeline) -> str:
    """The command that `scenewright run` executes, with make variables; an option of an unset variable vanishes."""
    values: dict[str, str | None] = {name: f"$({name.upper()})" for name in pipeline.variables}
    words = step_arguments(step, "$(FOLDER)", values)
    optional = {f"$({name.upper()})" for name, variable in pipeline.variables.items() if variable.optional}
    references = {f"$({name.upper()})" for name in pipeline.variables}
    text: list[str] = []
    for word in words:
        if word in optional:
            option = text.pop()
            text.append(f"$(if {word},{option} '{word}')")
        elif word in references:
            text.append(f"'{word}'")
        else:
            text.append(word if re.fullmatch(r"[\w$()./-]+", word) else f"'{word}'")
    return " ".join(text)


def makefile_for(pipeline: Pipeline) -> str:
    """Return the text of `data/pipelines/<name>.mk`; its first target builds the whole run in $(OUTPUTS)/$(RUN)."""
    specification = f"data/pipelines/{pipeline.name}.toml"
    lines = [
        f"# Generated from {specification} by `make rules`; do not edit. {pipeline.summary}",
        "# No .DELETE_ON_ERROR: an artifact whose outcome is not ok is complete and stays.",
        "PYTHON ?= .venv/bin/python",
        "OUTPUTS ?= outputs",
        f"RUN ?= {pipeline.name}",
        "FOLDER := $(OUTPUTS)/$(RUN)",
    ]
    for name, variable in pipeline.variables.items():
        upper = name.upper()
        if variable.default is not None:
            lines.append(f"{upper} ?= {variable.default}")
        elif not variable.optional:
            lines.append(f"$(if $({upper}),,$(error {pipeline.name} needs {upper}=... ({variable.description})))")
    raw = dict(given_inputs(pipeline))
    for input_name, kind in raw.items():
        if not kind.weights:  # those may be the name of cached ones
            reference = f"$({input_name.upper()})"
            missing = f"$(error {input_name.upper()}={reference}: no such file or folder)"
            lines.append(f"$(if {reference},$(if $(wildcard {reference}),,{missing}))")
    lines += [".PHONY: all", "all: " + " ".join(f"$(FOLDER)/{step.name}/manifest.json" for step in pipeline.step), ""]
    for step in pipeline.step:
        prerequisites = [specification]
        for source in step.inputs.values():
            match = _VARIABLE.match(source)
            if match and raw[match[1]].weights:
                prerequisites.append(f"$(wildcard $({match[1].upper()}))")
            elif match:
                prerequisites.append(f"$({match[1].upper()})")
            else:
                prerequisites.append(f"$(FOLDER)/{source.split('/')[0]}/manifest.json")
        lines.append(f"$(FOLDER)/{step.name}/manifest.json: {' '.join(dict.fromkeys(prerequisites))}")
        lines.append(f"\t$(PYTHON) -m scenewright {_recipe(step, pipeline)}")
        lines.append("")
    return "\n".join(lines)
