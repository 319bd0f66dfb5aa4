"""Rows of four against the loop over four numbers, to the last bit."""

from collections.abc import Callable

import numpy as np
import pytest

from auvident.jit import kernel
from auvident.physics import rows

ROW, OTHER, A, B, C, FIRST = 2, 5, 1, 3, 6, 4
NUMBER = 0.1


@kernel
def _fill(out, values, weights):
    rows.fill(out, ROW, NUMBER)


@kernel
def _place_scaled(out, values, weights):
    rows.place_scaled(out, ROW, NUMBER, values, OTHER)


@kernel
def _add_scaled(out, values, weights):
    rows.add_scaled(out, ROW, NUMBER, values, OTHER)


@kernel
def _place_product(out, values, weights):
    rows.place_product(out, ROW, NUMBER, values, A, B, C)


@kernel
def _add_product(out, values, weights):
    rows.add_product(out, ROW, NUMBER, values, A, B, C)


@kernel
def _add_weighted(out, values, weights):
    rows.add_weighted(out, ROW, weights, FIRST, NUMBER, values, A, B, C)


def _weighted(out: np.ndarray, values: np.ndarray, weights: np.ndarray) -> np.ndarray:
    by = [NUMBER * values[A, s] * values[B, s] * values[C, s] for s in range(4)]
    first, second, third, fourth = (weights[FIRST + s] * by[s] for s in range(4))
    return out[ROW] + (first + second + third + fourth)


LOOPS: dict[Callable[..., None], Callable[..., np.ndarray]] = {
    _fill: lambda out, values, weights: np.full(4, NUMBER),
    _place_scaled: lambda out, values, weights: NUMBER * values[OTHER],
    _add_scaled: lambda out, values, weights: out[ROW] + NUMBER * values[OTHER],
    _place_product: lambda out, values, weights: NUMBER * (values[A] * values[B] * values[C]),
    _add_product: lambda out, values, weights: (
        out[ROW] + NUMBER * (values[A] * values[B] * values[C])
    ),
    _add_weighted: _weighted,
}


@pytest.mark.parametrize("function", LOOPS, ids=lambda f: f.__name__.strip("_"))
@pytest.mark.parametrize("shape", [(8, 4), (4, 8)], ids=["rows", "wider"])
def test_a_row_is_four_numbers_one_after_another(
    function: Callable[..., None], shape: tuple[int, int]
) -> None:
    out, values, weights = np.random.default_rng(1).normal(size=(3, 8, 4))
    expected = out.copy()
    expected[ROW] = LOOPS[function](out, values, weights)
    given = [array.reshape(shape) for array in (out, values, weights)]
    function(*given)
    np.testing.assert_array_equal(given[0].reshape(8, 4), expected)
