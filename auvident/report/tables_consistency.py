"""Whether what the model leaves is noise: NIS, distribution and whiteness, with pass or fail."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

from auvident.report.loop_words import listed
from auvident.report.tables import Cell, Column, Fixed, Interval, Number, Table, columns
from auvident.report.verdict_rules import FAIL, LAGS, PASS

if TYPE_CHECKING:
    from auvident.schema.artifacts import (
        Autocorrelation,
        IdentifiedModel,
        Metrics,
        NisTest,
        ResidualTests,
        Role,
    )

LEAST_P = 0.05  # probability of a distance of Kolmogorov and Smirnov below which it fails
MANEUVERS = {
    "validate": "the held-out maneuvers",
    "identify": "the maneuvers used for identification",
}
SOURCES = {"validate": "prediction, held out", "identify": "prediction, identifying"}


def consistency(metrics: "Metrics | None", model: "IdentifiedModel | None") -> Table:
    """Three tests of every channel: size, distribution and colour of what is left."""
    rows: list[list[Cell]] = []
    for role, words in SOURCES.items():
        found = metrics.residuals.get(role, {}) if metrics else {}
        for channel, tests in found.items():
            if tests.nis is not None:
                told = [
                    *_size(tests.nis),
                    *_distribution(tests.nis),
                    *_colour(tests.autocorrelation),
                ]
                rows.append([words, channel, *told])
    for column, nis in _of_filter(model).items():
        words = f"{model.filter.upper()} innovations, last pass" if model else ""
        channel = column.partition("_")[0]
        rows.append([words, channel, *_size(nis), *_distribution(nis), "", "", ""])
    heads = (
        *columns(("what is left of", "channel")),
        *columns(numbers=("NIS", "its 95 % band")),
        Column("size"),
        *columns(numbers=("KS distance", "p")),
        Column("normal"),
        *columns(numbers=("largest autocorrelation", "lags outside")),
        Column("white"),
    )
    return Table(heads, rows)


def _of_filter(model: "IdentifiedModel | None") -> "Mapping[str, NisTest]":
    """Tests of the last pass of the filter that knows them."""
    for record in reversed(model.stages if model else ()):
        if record.nis and not record.fitted_noise:
            return record.nis
    return {}


def _size(nis: "NisTest") -> list[Cell]:
    return [Number(nis.corrected, 2), Interval(nis.low, nis.high), size_verdict(nis)]


def size_verdict(nis: "NisTest") -> str:
    """Whether the normalised innovation squared is within its band."""
    return PASS if nis.low <= nis.corrected <= nis.high else FAIL


def _distribution(nis: "NisTest") -> list[Cell]:
    if nis.ks is None or nis.ks_p is None:
        return ["", "", ""]
    return [Number(nis.ks, 2), Fixed(nis.ks_p, ".2f"), _normality(nis)]


def _normality(nis: "NisTest") -> str:
    """Whether the errors are normally distributed; empty where that is not known."""
    if nis.ks_p is None:
        return ""
    return PASS if nis.ks_p >= LEAST_P else FAIL


def _colour(white: "Autocorrelation | None") -> list[Cell]:
    if white is None:
        return ["", "", ""]
    return [
        Fixed(white.largest, "+.2f"),
        Fixed(100.0 * white.outside, ".0f", " %"),
        LAGS.of(white.outside).words,
    ]


def not_white(residuals: "Mapping[str, ResidualTests]") -> list[str]:
    """Channels whose errors are correlated in time beyond what their noise model says."""
    return [
        channel
        for channel, tests in residuals.items()
        if tests.autocorrelation and LAGS.of(tests.autocorrelation.outside).words == FAIL
    ]


def consistency_words(residuals: "Mapping[str, ResidualTests]", role: "Role" = "validate") -> str:
    """What the tests of the maneuvers of a role come to, in a sentence."""
    tested = {k: t.nis for k, t in residuals.items() if t.nis is not None}
    if not tested:
        return ""
    off = [k for k, nis in tested.items() if size_verdict(nis) == FAIL]
    coloured, lines = not_white(residuals), []
    if coloured:
        lines.append(
            f"Not entirely: the errors of {listed(coloured)} are correlated in time beyond "
            "what their noise model says, so something other than sensor noise is left."
        )
    if off:
        lines.append(f"{_those(lines)} of {listed(off)} do not have the size that it says.")
    odd = [k for k, nis in tested.items() if _normality(nis) == FAIL]
    if odd:
        lines.append(f"{_those(lines)} of {listed(odd)} are not normally distributed.")
    all_well = f"Yes: the errors of {MANEUVERS[role]} cannot be told from noise."
    return " ".join(lines) or all_well


def _those(lines: list[str]) -> str:
    """The errors, where no sentence before has named them."""
    return "Those" if lines else "Not entirely: the errors"
