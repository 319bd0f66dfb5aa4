"""A uniform current: the equations hold for the velocity through the water (Fossen 2021, 10.3).

The other side is written over ground: Newton's law for the rigid body with its velocity over
ground, the water's forces (added mass among them) with the velocity through the water, and
scipy's integrator.
"""

import numpy as np
import pytest

from auvident.engines.carried import predicted_course
from auvident.schema.artifacts import Sensing
from tests.engines.effects_world import FREELY, LEAD, World, blank, integrated
from tests.physics.plane_equations import stable_values

C = stable_values("horizontal")
ORIGIN = Sensing(dvl_x_m=0.0, dvl_y_m=0.0, dvl_z_m=0.0, dvl_mounting_yaw_rad=0.0, noise_std={})
CURRENTS = [(0.3, 0.0), (-0.2, 0.35), (0.0, -0.5)]


def over_ground(x: np.ndarray, inputs: np.ndarray, current: tuple[float, float]) -> np.ndarray:
    """Rate of (u, v, r, heading), u and v over ground."""
    u, v, r, heading = x
    d, e, n = inputs
    c, s = np.cos(heading), np.sin(heading)
    ahead, aside = current[0] * c + current[1] * s, current[1] * c - current[0] * s
    a, b = u - ahead, v - aside  # through the water
    m, mx = C["m"], C["m x_G"]
    water = np.array(
        [
            C["X_uu"] * a * abs(a)
            + C["X_vv"] * b * b
            + C["X_vr"] * b * r
            + C["X_rr"] * r * r
            + C["X_uudd"] * a * a * (d * d + e * e)
            + C["T_nn"] * n * abs(n)
            + C["T_nu"] * abs(n) * a,
            C["Y_uv"] * a * b
            + C["Y_ur"] * a * r
            + C["Y_v|v|"] * b * abs(b)
            + C["Y_r|r|"] * r * abs(r)
            + C["Y_uud"] * a * a * d,
            C["N_uv"] * a * b
            + C["N_ur"] * a * r
            + C["N_v|v|"] * b * abs(b)
            + C["N_r|r|"] * r * abs(r)
            + C["N_uud"] * a * a * d,
        ]
    )
    body = np.array([m * v * r + mx * r * r, -m * u * r, -mx * u * r])  # over ground
    added = np.array(
        [
            [-C["X_udot"], 0, 0],
            [0, -C["Y_vdot"], -C["Y_rdot"]],
            [0, -C["N_vdot"], -C["N_rdot"]],
        ]
    )
    rigid = np.array([[m, 0, 0], [0, m, mx], [0, mx, C["I"]]])
    turning = np.array([r * aside, -r * ahead, 0.0])  # rate of the current in the vehicle's axes
    rate = np.linalg.solve(rigid + added, water + body + added @ turning)
    return np.append(rate, r)


@pytest.mark.parametrize("current", CURRENTS)
def test_the_prediction_in_a_current_is_the_motion_over_ground(current) -> None:
    shown = dict(zip(("current.north_mps", "current.east_mps"), current, strict=True))
    world, record = World.of(shown, ORIGIN), blank(300)
    assert record.source is not None
    found = predicted_course(world.frame, world.p, record, FREELY)
    expected = integrated(
        lambda x, held: over_ground(x, held, current), record.source.start, record.source.raw[LEAD:]
    )
    # RK4 at 0.1 s: (dt/tau)^5/120 of a change of 0.5 at each helm, tau of 0.3 s at least: 2e-5,
    # and remembered for a few steps
    np.testing.assert_allclose(found.readings, expected, atol=1e-4)
    np.testing.assert_allclose(found.over_ground, found.readings, atol=1e-12)
    assert np.ptp(found.states[:, 3]) > 0.5  # it turns: the current comes from several sides
    still = predicted_course(world.frame, world.without().p, record, FREELY)
    assert np.abs(still.readings - expected).max() > 0.1
