"""Rendering the template: everything that comes from logs and artifacts is escaped."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import jinja2
from markupsafe import Markup

FOLDER = Path(__file__).resolve().parent


def render_page(values: dict[str, Any]) -> str:
    """Fill the template. All values are escaped; the style sheet, which is ours, is not."""
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(FOLDER), autoescape=True, undefined=jinja2.StrictUndefined, trim_blocks=False
    )
    style = Markup((FOLDER / "style.css").read_text(encoding="utf-8"))
    return environment.get_template("template.html.j2").render(**values, style=style)
