"""What to do with a folder of masks that no format reads, by the files that lie in it."""

from __future__ import annotations

from collections import Counter

from scenewright.stages.segment.backends.masks.listing import Listing

AS_NPZ = "np.savez(name, masks=...) for each image, masks (N, H, W) of bool (docs/MASKS.md)"
WAYS = {
    ".xml": "from CVAT export COCO 1.0 or Segmentation mask 1.1; a VOC file of boxes holds no masks",
    ".npy": f"load the arrays and write them with {AS_NPZ}",
    ".pt": f"load the tensors and write them with {AS_NPZ}",
    ".pth": f"load the tensors and write them with {AS_NPZ}",
    ".pkl": f"pickles are never read; load them where they were made, and write them with {AS_NPZ}",
    ".mat": f"load them with scipy.io.loadmat and write them with {AS_NPZ}",
    ".h5": f"load them with h5py and write them with {AS_NPZ}",
    ".tif": "write the same values as PNG (cv2.imwrite)",
    ".tiff": "write the same values as PNG (cv2.imwrite)",
    ".bmp": "write the same values as PNG (cv2.imwrite)",
    ".jpg": "JPEG changes the values of a mask: write the network's masks as PNG",
    ".jpeg": "JPEG changes the values of a mask: write the network's masks as PNG",
    ".zip": "unpack it and give the folder",
}
"""Ending of a file -> what to do."""
SHOWN = 4
"""Endings that a message names."""


def kinds_of_files(listing: Listing) -> str:
    """Return what lies in the folder: how many files of which ending, the most frequent first."""
    counts = Counter(file.suffix.lower() or "no ending" for file in listing.files)
    ordered = sorted(counts.items(), key=lambda row: (-row[1], row[0]))
    return ", ".join(f"{count} {ending}" for ending, count in ordered[:SHOWN])


def way_of(listing: Listing) -> str:
    """Return what to do with the most frequent file that a way is known for; empty: none is."""
    counts = Counter(file.suffix.lower() for file in listing.files)
    known = sorted((ending for ending in counts if ending in WAYS), key=lambda ending: (-counts[ending], ending))
    return WAYS[known[0]] if known else ""
