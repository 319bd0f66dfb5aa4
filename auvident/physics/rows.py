"""Rows of four numbers, each worked on by one instruction.

In a step (`sensitivity`) the same is done to four numbers all the time: to the points of RK4, or to
the states. numba's compiler unrolls a loop over four before it looks for what vector instructions
could do at once, and does not look any more afterwards, so that here they are written down. Every
number is rounded as in the loop: a row has the same bits as four numbers one after another.

Rows are counted through the memory of an array (n, 4), or (n, 4 k) with k rows in each of its own;
whether a row is in it is not checked.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
from llvmlite import ir
from numba import types

from auvident.jit import written

FOUR = ir.VectorType(ir.DoubleType(), 4)
PLACE = ir.IntType(32)  # of a number in its row
ALIGNMENT = 8  # bytes: a row begins where any number may
NUMBER, ROW = types.float64, types.intp
ROW_TYPE = ir.IntType(8 * np.dtype(np.intp).itemsize)


class _Rows:
    """The code of a function that works on rows, and its arguments by their positions."""

    def __init__(self, context: Any, builder: Any, signature: Any, arguments: Any) -> None:
        self._context, self._build = context, builder
        self._kinds, self._arguments = signature.args, arguments

    def _place(self, array: int, row: int, further: int = 0) -> Any:
        index = self._build.add(self._arguments[row], ROW_TYPE(further))
        held = self._context.make_array(self._kinds[array])
        data = held(self._context, self._build, self._arguments[array]).data
        first = self._build.gep(data, [self._build.mul(index, ROW_TYPE(4))])
        return self._build.bitcast(first, FOUR.as_pointer())

    def read(self, array: int, row: int, further: int = 0) -> Any:
        """A row of an array, or one so many further on."""
        return self._build.load(self._place(array, row, further), align=ALIGNMENT)

    def write(self, row: Any) -> None:
        """Put a row where the first two arguments say."""
        self._build.store(row, self._place(0, 1), align=ALIGNMENT)

    def add(self, row: Any) -> None:
        """Add a row to the one where the first two arguments say."""
        self.write(self.plus(self.read(0, 1), row))

    def number(self, position: int) -> Any:
        """A number four times."""
        none = ir.Constant(FOUR, ir.Undefined)
        return self._four(self._build.insert_element(none, self._arguments[position], PLACE(0)), 0)

    def _four(self, row: Any, place: int) -> Any:
        """The number at a place of a row four times."""
        places = ir.Constant(ir.VectorType(PLACE, 4), [PLACE(place)] * 4)
        return self._build.shuffle_vector(row, row, places)

    def plus(self, one: Any, other: Any) -> Any:
        """Sum of two rows."""
        return self._build.fadd(one, other)

    def times(self, first: Any, *others: Any) -> Any:
        """Product of rows, from the first to the last."""
        product = first
        for other in others:
            product = self._build.fmul(product, other)
        return product

    def weighted(self, array: int, row: int, weights: Any) -> Any:
        """Sum of four rows from one on, each times its number in another row."""
        parts = [self.times(self.read(array, row, k), self._four(weights, k)) for k in range(4)]
        return self.plus(self.plus(self.plus(parts[0], parts[1]), parts[2]), parts[3])


def _code(write: Callable[[_Rows], None], *kinds: Any) -> Any:
    """What numba asks of an intrinsic: kinds of its arguments, and who writes its code."""

    def generate(*call: Any) -> Any:
        write(_Rows(*call))
        return call[0].get_dummy_value()

    return types.void(*kinds), generate


@written
def fill(_typing: Any, out: Any, row: Any, number: Any) -> Any:
    """``out[row] = number``."""
    return _code(lambda r: r.write(r.number(2)), out, ROW, NUMBER)


@written
def place_scaled(_typing: Any, out: Any, row: Any, number: Any, values: Any, at: Any) -> Any:
    """``out[row] = number * values[at]``."""
    return _code(lambda r: r.write(_scaled(r)), out, ROW, NUMBER, values, ROW)


@written
def add_scaled(_typing: Any, out: Any, row: Any, number: Any, values: Any, at: Any) -> Any:
    """``out[row] += number * values[at]``."""
    return _code(lambda r: r.add(_scaled(r)), out, ROW, NUMBER, values, ROW)


def _scaled(r: _Rows) -> Any:
    return r.times(r.number(2), r.read(3, 4))


@written
def place_product(
    _typing: Any, out: Any, row: Any, number: Any, values: Any, a: Any, b: Any, c: Any
) -> Any:
    """``out[row] = number * (values[a] * values[b] * values[c])``."""
    return _code(lambda r: r.write(_product(r)), out, ROW, NUMBER, values, ROW, ROW, ROW)


@written
def add_product(
    _typing: Any, out: Any, row: Any, number: Any, values: Any, a: Any, b: Any, c: Any
) -> Any:
    """``out[row] += number * (values[a] * values[b] * values[c])``."""
    return _code(lambda r: r.add(_product(r)), out, ROW, NUMBER, values, ROW, ROW, ROW)


def _product(r: _Rows) -> Any:
    return r.times(r.number(2), r.times(r.read(3, 4), r.read(3, 5), r.read(3, 6)))


@written
def add_weighted(
    _typing: Any,
    out: Any,
    row: Any,
    rows: Any,
    first: Any,
    number: Any,
    values: Any,
    a: Any,
    b: Any,
    c: Any,
) -> Any:
    """``out[row] += rows[first : first + 4].T @ (number * values[a] * values[b] * values[c])``."""

    def write(r: _Rows) -> None:
        weights = r.times(r.number(4), r.read(5, 6), r.read(5, 7), r.read(5, 8))
        r.add(r.weighted(2, 3, weights))

    return _code(write, out, ROW, rows, ROW, NUMBER, values, ROW, ROW, ROW)
