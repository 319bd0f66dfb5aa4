"""The gates of held-out errors, in one plane and in two."""

import pytest

from auvident.errors import GateError
from auvident.pipeline.gates import Judged, check_planes, limit_gates
from auvident.schema.artifacts import RAN_AWAY, Finding
from auvident.schema.diagnosis import ChannelError

HORIZONTAL, VERTICAL = frozenset({"u", "v", "r"}), frozenset({"u", "w", "q"})
LOST = Finding(code=RAN_AWAY, message="", where="dive-2")


def judged(known: frozenset[str], found: dict[str, float], *findings: Finding) -> Judged:
    errors = {n: ChannelError(rmse=x, nrmse=x, unit="m/s") for n, x in found.items()}
    return Judged(errors, known, findings)


FLAT = judged(HORIZONTAL, {"u": 0.02, "v": 0.01, "r": 0.001})
STEEP = judged(VERTICAL, {"u": 0.03, "w": 0.01, "q": 0.002})


def test_every_channel_of_every_plane_is_named() -> None:
    limits = {"u": 0.001, "w": 0.001, "r": 0.1}
    with pytest.raises(GateError) as told:
        check_planes([FLAT, STEEP], limits)
    words = str(told.value)
    for said in ("horizontal plane", "u: RMSE 0.02", "vertical plane", "u: RMSE 0.03", "w: RMSE"):
        assert said in words
    assert "r: RMSE" not in words
    check_planes([FLAT, STEEP], {"u": 0.05, "w": 0.05})


def test_a_plane_with_nothing_held_out_meets_no_gate_of_its_channels_and_is_named() -> None:
    """What the other plane shows of the surge says nothing of a model that was not tested."""
    empty = Judged({}, HORIZONTAL, ())
    with pytest.raises(
        GateError, match="horizontal plane: no held-out maneuver measures u"
    ) as told:
        check_planes([empty, STEEP], {"u": 0.05})
    assert "vertical plane" not in str(told.value) and "--hold-out" in str(told.value)
    assert [bool(gate.unmet) for gate in limit_gates([empty, STEEP], {"u": 0.05})] == [True, False]
    with pytest.raises(GateError, match="no held-out maneuver measures u"):
        check_planes([empty], {"u": 0.05})


def test_gates_of_one_channel_in_two_planes_are_told_apart() -> None:
    """As cases of JUnit they had one name, and the summary said the same twice."""
    gates = limit_gates([FLAT, STEEP], {"u": 0.025, "w": 0.1})
    assert [(g.of, g.channel, bool(g.unmet)) for g in gates] == [
        ("horizontal plane", "u", False),
        ("vertical plane", "u", True),
        ("vertical plane", "w", False),
    ]
    assert [g.of for g in limit_gates([FLAT], {"u": 0.025})] == [""]


def test_a_plane_that_runs_away_is_not_excused_by_the_other() -> None:
    lost = judged(HORIZONTAL, {}, LOST)
    with pytest.raises(GateError, match="diverges"):
        check_planes([lost, STEEP], {"u": 0.05})
