"""Files of meshes."""

from __future__ import annotations

from tests.advice.rows import NotTried

ROWS = [
    NotTried("stages/kit/formats/gltf_extensions.py", "--formats avif", "gltf-transform does it, which is not here")
]
