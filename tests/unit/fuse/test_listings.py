"""The compact table of segments gives back what was read."""

from __future__ import annotations

from hypothesis import given, settings
from hypothesis import strategies as st
from scenewright.schemas.segments import FrameSegment, FrameSegments, SegmentsFile, Witness
from scenewright.stages.fuse.listings import Listings

witness = st.builds(Witness, network=st.integers(0, 5), class_id=st.integers(0, 200), score=st.floats(0, 1))
segment = st.fixed_dictionaries(
    {
        "id": st.integers(1, 2**24 - 1),
        "class_id": st.integers(0, 200),
        "instance": st.integers(0, 500),
        "is_thing": st.booleans(),
        "score": st.floats(0, 1),
        "area": st.integers(0, 10**7),
        "witnesses": st.lists(witness, max_size=3).map(tuple),
    }
).map(lambda fields: FrameSegment(**fields))
frames = st.dictionaries(st.integers(0, 5000), st.lists(segment, max_size=5), max_size=6)


@given(frames)
@settings(max_examples=50, deadline=None)
def test_every_frame_keeps_its_segments(listed: dict[int, list[FrameSegment]]) -> None:
    file = SegmentsFile(
        backend="geometric",
        label="",
        width=4,
        height=3,
        frames=tuple(FrameSegments(frame=index, segments=tuple(found)) for index, found in listed.items()),
    )
    listings = Listings(file)
    for index, found in listed.items():
        assert listings.get(index) == tuple(found)
    assert listings.get(9999) is None
