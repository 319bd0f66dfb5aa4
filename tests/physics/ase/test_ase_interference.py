import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from auvident.physics.ase import interference
from auvident.physics.ase.added_mass import one_fin_section, two_fin_section

# DATCOM 4.3.1.2-10 at tau = 0, 0.1, ... 1 (Digital DATCOM data statements).
TAU = np.linspace(0.0, 1.0, 11)
K_WB = [1, 1.08, 1.16, 1.26, 1.36, 1.46, 1.56, 1.67, 1.78, 1.89, 2]
K_BW = [0, 0.13, 0.29, 0.45, 0.62, 0.80, 1, 1.22, 1.45, 1.70, 2]


def test_factors_are_those_of_the_datcom_charts():
    assert interference.fin_on_body(TAU) == pytest.approx(K_WB, abs=0.012)  # chart reading
    carried_over = interference.fin_and_body(TAU) - interference.fin_on_body(TAU)
    assert carried_over == pytest.approx(K_BW, abs=0.025)  # chart reading


def test_limits_without_hull_and_beside_a_wall():
    ends = np.array([0.0, 1.0])
    assert interference.fin_on_body(ends) == pytest.approx([1.0, 2.0], abs=1e-12)
    assert interference.fin_and_body(ends) == pytest.approx([1.0, 4.0], abs=1e-12)
    assert interference.single_fin_and_body(ends) == pytest.approx([0.5, 4.0], abs=1e-12)
    assert interference.single_fin_on_body(ends) == pytest.approx([0.5, 2.0], abs=1e-9)


@given(st.floats(0.0, 0.999))
def test_factors_rise_without_jumps(tau):
    step = 1e-3
    for factor in (interference.fin_on_body, interference.single_fin_on_body):
        rise = float(factor(tau + step) - factor(tau))
        # slope of K_W(B) 0.7 to 1.2; of the single fin it begins with 6, half of 1 + 6 tau
        assert -1e-4 < rise < 4.0 * step


def test_lift_on_a_fin_pair_is_the_integral_of_its_potential_jump():
    """NACA 1307 eq. 14 against an independent integral (conformal map of circle and fins)."""
    for tau in (0.2, 0.5, 0.8):
        y = np.linspace(tau, 1.0, 400_001)
        # The map y + tau^2/y turns hull and fins into a flat plate of half width 1 + tau^2.
        jump = np.sqrt(np.maximum((1 + tau**2) ** 2 - (y + tau**2 / y) ** 2, 0.0))
        both = 2.0 * 2.0 * np.trapezoid(jump, y)
        alone = np.pi * (1.0 - tau) ** 2
        # trapezoid rule at a square-root edge: error about 1e-8
        assert float(interference.fin_on_body(tau)) == pytest.approx(both / alone, rel=1e-5)


def test_lift_at_incidence_follows_from_the_added_mass_of_the_sections():
    tau = np.array([0.1, 0.3, 0.5, 0.8])
    fin, circle = np.pi * (1.0 - tau) ** 2, np.pi * tau**2
    pair = (two_fin_section(1.0, np.ones(4), tau) - circle) / fin
    single = (one_fin_section(1.0, np.ones(4), tau) - circle) / (0.5 * fin)
    assert pair == pytest.approx(interference.fin_and_body(tau), rel=1e-12)
    assert single == pytest.approx(interference.single_fin_and_body(tau), rel=1e-12)
