"""three.js, out of the viewer that trimesh ships (MIT licence, both): nothing is vendored here and nothing fetched."""

from __future__ import annotations

import zipfile
from importlib.resources import files

from scenewright.schemas.errors import MissingDependency

TEMPLATE = ("resources", "templates", "viewer.zip")
PAGE = "viewer.html.template"
BEGIN = "/**\n * @license"
END = 'Object.defineProperty(t,"__esModule",{value:!0})}));'
"""How the library ends where it is packed for browsers."""


def three_js() -> str:
    """Return the text of three.js, which defines `THREE`. Raises MissingDependency when trimesh no longer ships it."""
    template = files("trimesh").joinpath(*TEMPLATE)
    try:
        with template.open("rb") as file, zipfile.ZipFile(file) as archive:
            text = archive.read(PAGE).decode("utf-8")
    except (OSError, KeyError, zipfile.BadZipFile) as error:
        raise MissingDependency(f"trimesh ships no viewer: {error}", hint="install requirements.lock") from None
    begin, end = text.find(BEGIN), text.find(END)
    if begin < 0 or end < begin:
        raise MissingDependency("trimesh ships another three.js", hint="install requirements.lock")
    return text[begin : end + len(END)]
