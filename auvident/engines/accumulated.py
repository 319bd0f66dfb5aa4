"""From a simulated record to what it adds to the likelihood, row by row.

The slopes of a reading are those of the states, seen by the sensors. `place_slopes` writes them
down; `normal_equations` whitens them in passing and adds up their products, so that no array of
rows by channels by parameters is made. The products are added `ROWS` at a time, so that the sums
are fetched and put back less often than with every row.
"""

import math
from typing import NamedTuple

import numpy as np

from auvident.estimation.coloured import next_variance, whiten_row
from auvident.jit import borrowing, kernel
from auvident.physics.readings import known_row, rows_of
from auvident.physics.rows import add_scaled, place_scaled
from auvident.physics.sensing import N_CHANNELS
from auvident.physics.term_tables import LEAD, N_STATES

ROWS = 8  # whose products are added at once
LARGEST = 1.0e20  # squared slopes in units of the noise beyond which a motion has run away


class Sees(NamedTuple):
    """How the sensors see the slopes of the states of a record.

    Attributes
    ----------
    matrix : (4, 4) array
        Reading = matrix @ state.
    by_pitch : (n, 2) or (0, 2) array
        Further slope of the readings of the DVL by the pitch; none where the water rests.
    dvl, gyro : float
        Steps by which these sensors are late.
    columns : (k,) int array
        Columns of the parameters that the readings themselves depend on.
    slopes : (n, 4, k) array
        Slopes of the readings by these, the motion held.
    """

    matrix: np.ndarray
    by_pitch: np.ndarray
    dvl: float
    gyro: float
    columns: np.ndarray
    slopes: np.ndarray


class Whitening(NamedTuple):
    """Noise of the channels, as `coloured.whiten` takes it, and where they are compared.

    Attributes
    ----------
    active : (4,) bool array
    keep, white, slow : (4,) array
    start : (4,) array
        Inverse variances of the start; 1 for inactive states.
    """

    active: np.ndarray
    keep: np.ndarray
    white: np.ndarray
    slow: np.ndarray
    start: np.ndarray


@borrowing
def _add_seen(k, share, c, sees, z, row):
    """Add a share of what channel c sees of the slopes in row k of z."""
    for i in range(N_STATES):
        weight = sees.matrix[c, i]
        if i == N_STATES - 1 and c < 2 and sees.by_pitch.shape[0] > 0:
            weight += sees.by_pitch[k, c]
        weight *= share
        if weight != 0.0:
            for column in range(1, row.shape[0]):
                row[column] += weight * z[k, i, column]


@borrowing
def _steps(c, sees):
    """Steps by which channel c is late."""
    return sees.dvl if c < 2 else (sees.gyro if c == 2 else 0.0)


@borrowing
def _place_row(k, c, sees, z, row):
    """Slopes of reading k of channel c in the columns of z; column 0 is left alone."""
    here, before, share = rows_of(k, z.shape[0], _steps(c, sees))
    for column in range(1, row.shape[0]):
        row[column] = 0.0
    _add_seen(here, 1.0 - share, c, sees, z, row)
    if share != 0.0:
        _add_seen(before, share, c, sees, z, row)
    for j in range(sees.columns.shape[0]):
        row[sees.columns[j]] += sees.slopes[k, c, j]


@borrowing
def _place_all(sees, z, out):
    """Fill `out` (n, 4, 5 + m) with the slopes of all readings."""
    for k in range(z.shape[0]):
        for c in range(N_CHANNELS):
            _place_row(k, c, sees, z, out[k, c])


@kernel
def place_slopes(sees, z, out):
    """Slopes of all readings.

    Parameters
    ----------
    sees : Sees
    z : (n, 4, 5 + m) array
        From `physics.dynamics.simulate_with_sensitivities`.
    out : (n, 4, 5 + m) array, filled
        In the columns of z; column 0 is left alone.
    """
    _place_all(sees, z, out)


@kernel
def left_over(readings, slopes, measured, seen, channels, start, error):
    """What a prediction leaves of the readings when its start moves back by so much.

    Parameters
    ----------
    readings, measured : (n, 4) array
    slopes : (n, 4, >= 4) array
        Of the readings by the start.
    seen : (n, 4) bool array
    channels : (k,) int array
        Active states, whose starts move and whose readings follow.
    start : (k,) array
    error : (n, 4) array, filled
        Measured minus predicted; NaN where not seen.
    """
    for t in range(error.shape[0]):
        for c in range(N_CHANNELS):
            error[t, c] = measured[t, c] - readings[t, c] if seen[t, c] else np.nan
        for c in channels:
            moved = 0.0
            for j in range(channels.shape[0]):
                moved += slopes[t, c, channels[j]] * start[j]
            error[t, c] += moved


@kernel
def all_within(values, most):
    """Whether no number of values (n, m) is larger than so much, nor a NaN."""
    for row in range(values.shape[0]):
        for column in range(values.shape[1]):
            if not abs(values[row, column]) <= most:
                return False
    return True


@borrowing
def _add_products(rows, part, gram):
    """Add the products of the columns of `ROWS` rows with each other, above the diagonal.

    Four at a time (`physics.rows`), so that some reach below the diagonal.
    """
    blocks = gram.shape[1] // 4
    for i in range(gram.shape[0]):
        for block in range(i // 4, blocks):
            place_scaled(part, 0, rows[0, i], rows, block)
            for row in range(1, ROWS):
                add_scaled(part, 0, rows[row, i], rows, row * blocks + block)
            add_scaled(gram, i * blocks + block, 1.0, part, 0)


@borrowing
def _accumulate(z, sees, readings, measured, noise, states, variance, rows, part, gram):
    """Add the products of all white rows to gram; the number of lost readings."""
    n, filled, lost, width = z.shape[0], 0, 0, z.shape[2]
    for k in range(n):
        for c in range(N_CHANNELS):
            if not noise.active[c]:
                continue
            state, keep, slow, gain = states[c], noise.keep[c], noise.slow[c], 0.0
            if math.isfinite(measured[k, c]) and known_row(k, n, _steps(c, sees)):
                spread = variance[c] + noise.white[c] * noise.white[c]
                gain = variance[c] / spread
                row = rows[filled, :width]
                _place_row(k, c, sees, z, row)
                row[0] = readings[k, c] - measured[k, c]
                whiten_row(row, state, gain, 1.0 / math.sqrt(spread), keep)
                filled += 1
            else:
                lost += 1 if math.isfinite(measured[k, c]) else 0
                for column in range(width):
                    state[column] *= keep
            variance[c] = next_variance(variance[c], gain, keep, slow)
            if filled == ROWS:
                _add_products(rows, part, gram)
                filled = 0
    for row in range(filled, ROWS):
        for column in range(rows.shape[1]):
            rows[row, column] = 0.0
    _add_products(rows, part, gram)
    return lost


@borrowing
def _eliminate(start_information, moved, gram):
    """Take out of gram (C, C) what the start takes up; False where the motion ran away.

    The start is expected where it was before it was moved.
    """
    size = gram.shape[0]
    for i in range(size):
        for j in range(i, size):
            if not abs(gram[i, j]) <= LARGEST:  # nor a NaN: not far enough away to be stopped
                return False
            gram[j, i] = gram[i, j]
    for s in range(N_STATES):
        pull = start_information[s] * moved[s]
        gram[0, 0] += pull * moved[s]
        gram[0, 1 + s] += pull
        gram[1 + s, 0] += pull
        gram[1 + s, 1 + s] += start_information[s]
    for s in range(1, LEAD):
        for i in range(size):
            share = gram[i, s] / gram[s, s]
            if i == 0 or i > s:
                for j in range(size):
                    gram[i, j] -= share * gram[s, j]
    return True


@kernel
def normal_equations(z, sees, readings, measured, noise, moved, gram):
    """What a record adds to the likelihood, its start eliminated.

    Parameters
    ----------
    z, sees :
        See `place_slopes`.
    readings, measured : (n, 4) array
        As predicted; as read, NaN where nothing was.
    noise : Whitening
    moved : (4,) array
        How far the start has been moved from where it is expected.
    gram : (5 + m, 5 + m) array, filled
        Products of error and slopes: squared error at (0, 0), the gradient from (5, 0) on, the
        curvature from (5, 5) on. The rows of the start are of no use afterwards.

    Returns
    -------
    int
        Readings that are lost, as a late sensor's first ones; -1 where the motion ran away.
    """
    width = z.shape[2]
    padded = 4 * ((width + 3) // 4)
    rows, states = np.zeros((ROWS, padded)), np.zeros((N_CHANNELS, width))
    sums, variance = np.zeros((width, padded)), noise.slow * noise.slow
    part = np.zeros((1, 4))
    lost = _accumulate(z, sees, readings, measured, noise, states, variance, rows, part, sums)
    for i in range(width):
        for j in range(width):
            gram[i, j] = sums[i, j]
    return lost if _eliminate(noise.start, moved, gram) else -1
