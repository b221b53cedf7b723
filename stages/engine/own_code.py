"""What makes another Python process run this very code, whatever its working folder and wherever this code lies."""

from __future__ import annotations

import os
import site
import sysconfig

from scenewright.schemas.places import import_folder


def own_code() -> dict[str, str]:
    """Return the variables for its environment: what this process was given to import from goes on holding.

    Of an installation among the other packages nothing needs to be said: there, `PYTHONPATH` would put all of those
    before the standard library.
    """
    given = [folder for folder in os.environ.get("PYTHONPATH", "").split(os.pathsep) if folder]
    found = {sysconfig.get_path("purelib"), sysconfig.get_path("platlib"), site.getusersitepackages()}
    own = str(import_folder())
    folders = dict.fromkeys(given if own in found else [own, *given])
    paths = {"PYTHONPATH": os.pathsep.join(folders)} if folders else {}
    return {**paths, "PYTHONSAFEPATH": "1"}  # the working folder may be a checkout with other code
