"""Ranges among thousands: as by looking at each of them."""

from hypothesis import given
from hypothesis import strategies as st

from auvident.stages.segment.spans import Spans

ranges = st.tuples(st.integers(0, 40), st.integers(0, 12)).map(lambda x: (x[0], x[0] + x[1]))


@given(st.lists(ranges, max_size=12), ranges)
def test_a_range_meets_one_of_them(known: list[tuple[int, int]], asked: tuple[int, int]) -> None:
    start, stop = asked
    expected = any(a < stop and start < b for a, b in known)
    added = Spans()
    for a, b in known:
        added.add(a, b)
    assert Spans(known).meets(start, stop) == added.meets(start, stop) == expected


@given(st.lists(ranges, max_size=12), st.integers(0, 60))
def test_a_sample_lies_in_one_of_them(known: list[tuple[int, int]], sample: int) -> None:
    assert Spans(known).holds(sample) == any(a <= sample < b for a, b in known)
