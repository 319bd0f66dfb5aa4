"""The fit by other means has the cost of the package's own."""

import numpy as np
import pytest

from tests.bench import against_casadi as bench

# of CasADi only the order of the sums differs; numpy has its slopes by the start from differences
BY = {"casadi": (bench.casadi_residuals, 1e-12), "numpy": (bench.numpy_residuals, 1e-9)}


@pytest.fixture(scope="module")
def case() -> bench.Case:
    return bench.case_of(most=1)


@pytest.mark.parametrize("library", BY)
def test_the_cost_is_that_of_the_package(case: bench.Case, library: str) -> None:
    pytest.importorskip(library)
    made, tolerance = BY[library]
    residuals = made(case)
    for theta in (np.zeros(len(case.free.positions)), bench.own_fit(case)[0]):
        assert bench.half_square(residuals, theta) == pytest.approx(
            bench.own_cost(case, theta), rel=tolerance
        )


def test_the_curvature_by_casadi_and_by_differences_is_the_same(case: bench.Case) -> None:
    pytest.importorskip("casadi")
    theta = bench.own_fit(case)[0]
    exact, near = (made(case)(theta)[1] for made, _ in BY.values())
    size = np.sqrt(np.diag(exact.T @ exact))
    assert (np.abs(exact.T @ exact - near.T @ near) < 1e-4 * np.outer(size, size)).all()
