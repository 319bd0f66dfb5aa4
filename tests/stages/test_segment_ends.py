"""The segment stage near the ends of a record: whatever the length, no range leaves it."""

import numpy as np
import pytest
from segment_world import DEG, Sail, Ship

from auvident.errors import InputError
from auvident.physics.maneuvers.straight import RPM_LEVEL_SHARE
from auvident.schema.trial import Trial
from auvident.stages.segment import segment
from auvident.stages.segment.pieces import Piece, pieces_of
from auvident.stages.segment.scales import Scales, scales_of
from auvident.stages.segment.turns import thrust_steps

CALM = Ship(u_noise=0.0, r_noise_degps=0.0, heading_noise_deg=0.0)


def stepped(rows: int, at: int) -> tuple[Piece, Scales]:
    """A piece of some rows whose propeller rate steps at one of them."""
    s = Sail(CALM, np.random.default_rng(0))
    for i in range(rows):
        s.step(0.0, 900.0 if i < at else 1100.0)
    (piece,) = pieces_of(s.trial())
    return piece, scales_of([piece])


def changes(piece: Piece, scales: Scales, start: int, stop: int) -> list[int]:
    """`thrust_steps` by its words: where the change over a second first passes the limit."""
    second, limit = piece.samples(1.0), max(RPM_LEVEL_SHARE * scales.rpm, 4 * scales.rpm_noise)
    found, before = [], False
    for i in range(max(start, second), min(stop, piece.size)):
        now = abs(piece.rpm[i] - piece.rpm[i - second]) > limit
        if now and not before:
            found.append(i)
        before = now
    return found


@pytest.mark.parametrize("at", [3, 30, 57, 59])
def test_thrust_steps_of_every_range_inside_and_beyond_a_record(at) -> None:
    rows = 60
    piece, scales = stepped(rows, at)
    for start in range(-25, rows + 25):
        for stop in range(start, rows + 45):
            expected = changes(piece, scales, start, stop)
            assert thrust_steps(piece, scales, start, stop) == expected, (start, stop)


def eased_at_the_end() -> Trial:
    """A rudder laid for a moment together with a new speed, and eased off slowly."""
    s = Sail(CALM, np.random.default_rng(0))
    s.u = CALM.cruise_mps
    s.fixed(40, 900)
    s.fixed(0.6, 1100, 12 * DEG)
    for share in np.linspace(0.95, 0.0, 20):
        s.fixed(0.1, 1100, share * 12 * DEG)
    s.fixed(5, 1100)
    return s.trial()


def test_a_record_that_ends_at_any_row_of_a_change_of_course_is_no_crash() -> None:
    whole = eased_at_the_end()
    for rows in range(400, len(whole.table) + 1):
        short = whole.with_table(whole.table.iloc[:rows].reset_index(drop=True))
        with pytest.raises(InputError, match="no horizontal maneuver"):
            segment([short])
