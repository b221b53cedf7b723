"""What speaks for a relation of a contact graph, in words."""

from __future__ import annotations

from scenewright.schemas.scene_parts import Relation


def evidence(link: Relation) -> str:
    """Return confidence and evidence of a relation in words: plane, gap, overlap, share inside, where they meet; of an
    unknown carrier, why it is unknown."""
    if link.because:
        return link.because
    phrases = [f"confidence {link.confidence:.2f}"]
    if link.plane is not None:
        phrases.append(f"plane {link.plane} of {link.source}")
    if link.gap is not None:
        phrases.append(f"gap {1000 * link.gap:.0f} mm")
    if link.overlap is not None:
        phrases.append(f"overlap {100 * link.overlap:.0f} %")
    if link.inside is not None:
        phrases.append(f"inside {100 * link.inside:.0f} %")
    if link.contact is not None:
        phrases.append("meet at " + ", ".join(f"{value:.2f}" for value in link.contact))
    return ", ".join(phrases)
