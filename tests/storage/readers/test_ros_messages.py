"""Serialised messages by their definition, held against the library's own serialisation."""

import numpy as np
import pytest

from auvident.storage.readers.ros_messages import MalformedError, columns_of, layout_of

typesys = pytest.importorskip("rosbags.typesys", reason="needs rosbags")
INNER = "lab/msg/Inner"
OUTER = "lab/msg/Outer"
DEFINITION = """uint8 first
float64 second
string name
int16 third
lab/Inner[] parts
bool last
int64[2] pair
builtin_interfaces/Time seen
uint8[] image
float32[] tail
"""


def store():
    made = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)
    made.register(typesys.get_types_from_msg("int8 small\nfloat32 large\n", INNER))
    made.register(typesys.get_types_from_msg(DEFINITION, OUTER))
    return made


def messages(made, rng, count=40):
    inner, time = made.types[INNER], made.types["builtin_interfaces/msg/Time"]
    return [
        made.types[OUTER](
            int(rng.integers(255)),
            float(rng.normal()),
            "x" * int(rng.integers(6)),
            int(rng.integers(-500, 500)),
            [inner(int(rng.integers(99)), float(rng.integers(9))) for _ in range(rng.integers(3))],
            bool(rng.integers(2)),
            rng.integers(-(2**40), 2**40, 2),
            time(int(rng.integers(2**31)), int(rng.integers(10**9))),
            rng.integers(0, 255, 70 + int(rng.integers(3)), dtype=np.uint8),
            rng.normal(size=int(rng.integers(3))).astype(np.float32),
        )
        for _ in range(count)
    ]


@pytest.mark.parametrize("how", ["ros1", "little", "big", "both"])
def test_columns_are_the_fields_of_the_messages(how):
    made, rng = store(), np.random.default_rng(1)
    sent = messages(made, rng)
    if how == "ros1":
        raw = [bytes(made.serialize_ros1(m, OUTER)) for m in sent]
    else:
        order = {"little": (True,), "big": (False,), "both": (True, False)}[how]
        raw = [
            bytes(made.serialize_cdr(m, OUTER, little_endian=order[i % len(order)]))
            for i, m in enumerate(sent)
        ]
    found = columns_of(made.fielddefs, OUTER, raw, how != "ros1")
    assert not [name for name in found if name.startswith(("image", "name"))]
    for column in ("first", "second", "third", "last"):
        np.testing.assert_array_equal(found[column], [getattr(m, column) for m in sent])
    np.testing.assert_array_equal(found["pair[1]"], [m.pair[1] for m in sent])
    stamps = [m.seen.sec * 10**9 + m.seen.nanosec for m in sent]
    np.testing.assert_array_equal(found["seen_ns"], stamps)
    second = [m.parts[1].large if len(m.parts) > 1 else np.nan for m in sent]
    np.testing.assert_array_equal(found["parts[1].large"], second)
    tail = [m.tail[0] if len(m.tail) else np.nan for m in sent]
    np.testing.assert_array_equal(found["tail[0]"], tail)


def parsed(text, name=OUTER):
    return typesys.get_types_from_msg(text, name)


@pytest.mark.parametrize(
    ("text", "data", "words"),
    [
        ("float64 x\n", bytes(7), "ends after 7 bytes"),
        ("float64 x\n", bytes(9), "9 bytes where .* takes 8"),
        ("lab/Outer[] x\n", b"\x01\0\0\0" * 99, "contains itself"),
        ("float64[2000000000] x\n", bytes(80), "ends after"),
        ("lab/Outer[4000000000] x\n", bytes(80), "contains itself|ends after"),
        ("lab/Other x\n", bytes(8), "no definition of lab/msg/Other"),
        ("string x\n", b"\xff\xff\xff\xff", "ends after"),
    ],
)
def test_messages_that_do_not_fit_their_definition(text, data, words):
    with pytest.raises(MalformedError, match=words):
        layout_of(parsed(text), OUTER, data, False)


def test_elements_of_no_size_are_not_counted_to_the_end():
    definitions = parsed("lab/Nothing[] x\n") | parsed("", "lab/msg/Nothing")
    assert layout_of(definitions, OUTER, b"\xff\xff\xff\xff", False).places == {}
