"""The terms of one system, sorted once for the loops that add them up in every step.

The powers of all variables stand in one row of values: variable by variable, then the factor 1
(`ONE`). A sorted table says for each term at which places its factors stand, so that a loop
multiplies without asking what they are. `batch` works with many points side by side (`sort_terms`),
`sensitivity` with one point and its derivatives (`sort_slopes`, `sort_masses`).

Tables that only hold indices are unsigned, which spares the loops the test for negative ones.
"""

import numpy as np

from auvident.jit import kernel

N_STATES = 4
N_VELOCITIES = 3
N_VARIABLES = 20
N_INPUTS = 15  # the last variables: control surfaces, propeller rate and what effects need
N_POWERS = 5
N_POSITIONS = 5  # variables that depend on the state: u, a, b, sine and cosine of the angle
N_FACTORS = 3  # of a term
ONE = N_VARIABLES * N_POWERS  # place of the factor 1, after the powers of all variables
P_SCALARS = ONE + 1  # many points: place of the first parameter among the scalars ...
P_ROWS = ONE  # ... and among the rows
SLOPES = ONE + 1  # one point: place of the first derivative of a power, after the powers and the 1
N_PARTIALS = N_STATES + N_INPUTS  # a force has a slope by each state and by each input
LEAD = 1 + N_STATES  # columns of a step before those of the parameters: state, derivatives by it


@kernel
def varies(variable, active, moving):
    """Whether a variable of a term differs from point to point (moving: inputs (15,) that do)."""
    if variable < N_POSITIONS:
        return active[min(variable, N_STATES - 1)]
    return moving[variable - N_POSITIONS]


@kernel
def used_variables(active, terms):
    """Variables (20,) that stand in the terms of the active equations."""
    used = np.zeros(N_VARIABLES, np.bool_)
    for k in range(terms.shape[0]):
        for c in range(2, terms.shape[1], 2):
            if active[terms[k, 0]] and terms[k, c + 1] >= 0:
                used[terms[k, c]] = True
    return used


@kernel
def standing_in(table):
    """Variables (20,) that stand in the terms at work, as `sort_slopes` sorted them."""
    used = np.zeros(N_VARIABLES, np.bool_)
    for k in range(table.shape[0]):
        for c in range(3, 3 + N_FACTORS):
            if table[k, c] != ONE:
                used[table[k, c] // N_POWERS] = True
    return used


@kernel
def sort_terms(active, moves, moving, terms, weights):
    """Sort the terms of the active equations for many points.

    Parameters
    ----------
    active : (4,) bool array
    moves : (n_parameters,) bool array
        Whether a parameter differs from point to point.
    moving : (15,) bool array
        Whether an input does.
    terms, weights : arrays of `terms.Structure`

    Returns
    -------
    sorted_terms : (m, 10) uint array
        Equation, number of factors that are rows, places of the four shared factors among the
        scalars, places of the others among the rows.
    weights : (m,) array
    """
    chosen, count = np.empty(terms.shape[0], np.int64), 0
    for k in range(terms.shape[0]):  # `np.flatnonzero` has numba load 200 modules with the kernel
        if active[terms[k, 0]]:
            chosen[count] = k
            count += 1
    table = np.zeros((count, 10), np.uintp)
    for k in range(count):
        term, n = terms[chosen[k]], 0
        table[k, 0], table[k, 2:6] = term[0], ONE
        table[k, 5] = P_SCALARS + term[1]
        if moves[term[1]]:
            table[k, 5], table[k, 6], n = ONE, P_ROWS + term[1], 1
        for c in range(N_FACTORS):
            variable, power = term[2 + 2 * c], term[3 + 2 * c]
            if power >= 0 and varies(variable, active, moving):
                table[k, 6 + n] = variable * N_POWERS + power
                n += 1
            elif power >= 0:
                table[k, 2 + c] = variable * N_POWERS + power
        table[k, 1] = n
    return table, weights[chosen[:count]]


@kernel
def needed_powers(active, moving, terms):
    """Variable and power (k, 2) of every power in a term that differs from point to point."""
    needed = np.zeros((N_VARIABLES, N_POWERS), np.bool_)
    for k in range(terms.shape[0]):
        for c in range(2, terms.shape[1], 2):
            variable, power = terms[k, c], terms[k, c + 1]
            if active[terms[k, 0]] and power >= 0 and varies(variable, active, moving):
                needed[variable, 0] = needed[variable, power] = True
    powers, k = np.zeros((N_VARIABLES * N_POWERS, 2), np.int64), 0
    for variable in range(N_VARIABLES):
        for power in range(N_POWERS):
            if needed[variable, power]:
                powers[k, 0], powers[k, 1] = variable, power
                k += 1
    return powers[:k].copy()


@kernel
def sort_slopes(active, p, column, scale, moving, terms, weights):
    """Sort the terms of the active equations with their derivatives.

    Parameters
    ----------
    active : (4,) bool array
    p : (n_parameters,) array
        Terms of parameters that are zero and not free are left out.
    column, scale : (n_parameters,) int array, (n_free,) array
        Column of each parameter, or -1 when it is not free; unit of each column.
    moving : (15,) bool array
        Inputs that depend on free parameters.
    terms, weights : arrays of `terms.Structure`

    Returns
    -------
    sorted_terms : (m, 6) uint array
        Equation, parameter, column (after `LEAD` others; one too many when the parameter is not
        free), places of the three factors; sorted by equation.
    weights : (m, 2) array
        Weight, weight in units of the column (zero when it is not free).
    partials : (d, 6) uint array
        Term, place of the slope of the force (19 times the equation, plus the state, or from 4 on
        the input), places of the slope and of the other two factors, whether the slope of the force
        is that of the row before.
    """
    chosen = _by_equation(active, p, column, terms)
    m = chosen.shape[0]
    table, sorted_weights = np.zeros((m, 6), np.uintp), np.zeros((m, 2))
    for k in range(m):
        row = chosen[k]
        equation, parameter = terms[row, 0], terms[row, 1]
        c = column[parameter]
        sorted_weights[k, 0] = weights[row]
        table[k, 0], table[k, 1], table[k, 2] = equation, parameter, LEAD + scale.shape[0]
        if c >= 0:
            table[k, 2], sorted_weights[k, 1] = LEAD + c, weights[row] * scale[c]
        for f in range(N_FACTORS):
            variable, power = terms[row, 2 + 2 * f], terms[row, 3 + 2 * f]
            table[k, 3 + f] = variable * N_POWERS + power if power >= 0 else ONE
    return table, sorted_weights, _sort_partials(active, moving, terms, chosen, table)


@kernel
def first_terms(table):
    """Rows (4,) of the sorted terms at which those of each equation begin, and where all end."""
    first = np.zeros(N_VELOCITIES + 1, np.uintp)
    for k in range(table.shape[0]):
        for equation in range(table[k, 0] + 1, N_VELOCITIES + 1):
            first[equation] = k + 1
    return first


@kernel
def _by_equation(active, p, column, terms):
    """Rows of the terms at work in the active equations, sorted by equation."""
    rows, n = np.empty(terms.shape[0], np.int64), 0
    for equation in range(N_VELOCITIES):
        for k in range(terms.shape[0]):
            at_work = p[terms[k, 1]] != 0.0 or column[terms[k, 1]] >= 0
            if active[equation] and terms[k, 0] == equation and at_work:
                rows[n] = k
                n += 1
    return rows[:n].copy()


@kernel
def _sort_partials(active, moving, terms, chosen, table):
    """`partials` of `sort_slopes`: each factor that varies is differentiated once."""
    partials, d = np.zeros((N_FACTORS * chosen.shape[0], 6), np.uintp), 0
    for equation in range(N_VELOCITIES):
        for by in range(N_PARTIALS):
            first = d
            for k in range(chosen.shape[0]):
                for f in range(N_FACTORS):
                    variable, power = terms[chosen[k], 2 + 2 * f], terms[chosen[k], 3 + 2 * f]
                    if (
                        terms[chosen[k], 0] == equation
                        and power >= 0
                        and _slope_of(variable) == by
                        and varies(variable, active, moving)
                    ):
                        partials[d, 0], partials[d, 1] = k, N_PARTIALS * equation + by
                        partials[d, 2] = SLOPES + variable * N_POWERS + power
                        partials[d, 3] = table[k, 3 + (f + 1) % N_FACTORS]
                        partials[d, 4] = table[k, 3 + (f + 2) % N_FACTORS]
                        partials[d, 5] = d > first
                        d += 1
    return partials[:d].copy()


@kernel
def _slope_of(variable):
    """State a variable depends on (sine and cosine: on the angle), or from 4 on the input it is."""
    if variable < N_POSITIONS:
        return min(variable, N_STATES - 1)
    return N_STATES + variable - N_POSITIONS


@kernel
def sort_masses(active, column, scale, mass, mass_weights):
    """Entries of the mass matrix among active states with their derivatives.

    Returns
    -------
    sorted_mass : (q, 5) uint array
        Row, column and place (row by row) in the matrix, parameter, column of its sensitivity.
    weights : (q, 2) array
        Both as in `sort_slopes`.
    """
    table, n = np.zeros((mass.shape[0], 5), np.uintp), 0
    sorted_weights = np.zeros((mass.shape[0], 2))
    for k in range(mass.shape[0]):
        i, j, parameter = mass[k, 0], mass[k, 1], mass[k, 2]
        if not (active[i] and active[j]):
            continue
        c = column[parameter]
        table[n, 0], table[n, 1], table[n, 2], table[n, 3] = i, j, 3 * i + j, parameter
        table[n, 4], sorted_weights[n, 0] = LEAD + scale.shape[0], mass_weights[k]
        if c >= 0:
            table[n, 4], sorted_weights[n, 1] = LEAD + c, mass_weights[k] * scale[c]
        n += 1
    return table[:n].copy(), sorted_weights[:n].copy()
