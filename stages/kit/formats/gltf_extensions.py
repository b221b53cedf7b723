"""Extensions that a glTF needs and nothing here decodes: named, with the command that is rid of them."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any

from scenewright.schemas.errors import BadInput

CONVERTER = "npx @gltf-transform/cli"
WAYS_OUT = {
    **dict.fromkeys(
        ("KHR_draco_mesh_compression", "EXT_meshopt_compression", "KHR_meshopt_compression"), "copy {name} OUT.glb"
    ),
    "KHR_mesh_quantization": "dequantize {name} OUT.glb",
    "KHR_texture_basisu": "ktxdecompress {name} OUT.glb, with KTX-Software installed",
    "EXT_texture_avif": "png {name} OUT.glb --formats avif",
}
"""Extension -> command of glTF Transform that writes the file without it."""
APPEARANCE = ("KHR_materials_", "KHR_lights_", "EXT_lights_", "KHR_texture_transform", "EXT_texture_webp", "KHR_xmp")
"""Beginnings of names of extensions that change no shape, or that are read."""


def way_out(extension: str, name: str) -> str:
    """Return what to do with a file of this name that needs an extension."""
    command = WAYS_OUT.get(extension, "").format(name=name)
    return f"{CONVERTER} {command}" if command else f"export it without {extension}"


def refuse_extensions(tree: Mapping[str, Any], name: str, read: Collection[str] = ()) -> None:
    """Raise BadInput with the first extension that a glTF requires and that is neither appearance nor in `read`.

    An array without data is taken for a sign too: writers forget to list what compressed it. Raises TypeError and
    AttributeError for a description that is none.
    """
    required = [str(entry) for entry in tree.get("extensionsRequired", ())]
    empty = any("bufferView" not in accessor and "sparse" not in accessor for accessor in tree.get("accessors", ()))
    if empty:
        required += [str(entry) for entry in tree.get("extensionsUsed", ()) if str(entry) in WAYS_OUT]
    for extension in required:
        if extension not in read and not extension.startswith(APPEARANCE):
            raise BadInput(f"needs the extension {extension:.60}, which is not read", hint=way_out(extension, name))
    if empty:
        raise BadInput("an array has no data (no bufferView)", hint="export it without compression")
