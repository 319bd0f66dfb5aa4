"""Closed forms of tails against `scipy.special`."""

import numpy as np
import pytest
from scipy import special

from auvident.estimation.chances import (
    chi_square_above,
    kolmogorov_above,
    normal_below,
    normal_quantile,
    student_quantile,
)


@pytest.mark.parametrize("freedom", [1, 2, 3, 8, 19, 60, 97, 200, 4001])
def test_chi_square(freedom: int) -> None:
    spread = np.concatenate([np.geomspace(1e-3, 3.0, 40), freedom * np.geomspace(0.1, 9.0, 90)])
    values = np.append(spread, 0.0)
    found = [chi_square_above(freedom, float(value)) for value in values]
    assert found == pytest.approx(special.chdtrc(freedom, values), rel=1e-10, abs=1e-250)


def test_normal() -> None:
    values = np.linspace(-9.0, 9.0, 1001)
    assert normal_below(values) == pytest.approx(special.ndtr(values), rel=1e-12)
    for share in (1e-9, 0.025, 0.5, 0.975, 1.0 - 1e-9):
        assert normal_quantile(share) == pytest.approx(special.ndtri(share), abs=1e-13)


@pytest.mark.parametrize("freedom", [1, 2, 3, 4, 7, 12, 59, 120])
def test_student(freedom: int) -> None:
    for share in (0.5001, 0.6, 0.9, 0.975, 0.9999):
        expected = special.stdtrit(freedom, share)
        assert student_quantile(freedom, share) == pytest.approx(expected, rel=1e-9)


def test_kolmogorov() -> None:
    values = np.concatenate([[-1.0, 0.0], np.linspace(0.005, 6.0, 1200)])
    found = [kolmogorov_above(float(value)) for value in values]
    assert found == pytest.approx(np.where(values < 0, 1.0, special.kolmogorov(values)), abs=1e-14)
