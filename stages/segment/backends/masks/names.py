"""The name that a picture had before a labelling service renamed it."""

from __future__ import annotations

import re

ROBOFLOW = re.compile(r"(?:_(?:png|jpe?g|bmp|tiff?|webp|avif|heic))?\.rf\.[0-9A-Za-z]{8,}(?:_mask)?$", re.IGNORECASE)
"""What Roboflow makes of the ending of `x.png`: `x_png.rf.<hash>.jpg`, and `..._mask.png` for its mask."""

LABEL_STUDIO = re.compile(r"^(?=\d*[a-f])[0-9a-f]{8}-(?=(?:\d{6,9}|\d{1,10}\.\d+|\d{13,19})$)", re.ASCII)
"""What Label Studio puts before the name of an upload, here of one that is a frame's or a stamp."""


def own_name(stem: str) -> str:
    """Return the stem of a file name without what services put around it: `x_png.rf.<hash>` is `x`."""
    return LABEL_STUDIO.sub("", ROBOFLOW.sub("", stem)) or stem
