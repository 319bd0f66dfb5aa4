"""Whether what is left is noise: judged in the table, in words and in the figure."""

import re

import numpy as np
import pandas as pd

from auvident.report.figures import style
from auvident.report.figures_innovations import innovations
from auvident.report.numbers import PAGE
from auvident.report.tables import written
from auvident.report.tables_consistency import consistency, consistency_words
from auvident.schema.artifacts import (
    Autocorrelation,
    FittedNoise,
    Metrics,
    NisTest,
    ResidualTests,
)


def left(nis: float = 1.0, p: float = 0.5, outside: float = 0.04) -> ResidualTests:
    lags = tuple(0.1 * k for k in range(1, 51))
    return ResidualTests(
        noise=FittedNoise(white_std=0.01, slow_std=0.0, slow_time_s=1.0),
        nis=NisTest(mean=nis, correlation=1.0, corrected=nis, low=0.9, high=1.1, ks=0.02, ks_p=p),
        autocorrelation=Autocorrelation(
            largest=0.1,
            lag_s=0.3,
            band=0.06,
            outside=outside,
            p=0.2,
            lags_s=lags,
            values=tuple(0.02 for _ in lags),
        ),
    )


def judged(tests: ResidualTests) -> tuple[str, ...]:
    metrics = Metrics(maneuvers=(), summary={}, residuals={"validate": {"u": tests}})
    (row,) = written(consistency(metrics, None), PAGE).rows
    return row[4], row[7], row[10]


def test_each_test_passes_or_fails_by_itself() -> None:
    assert judged(left()) == ("pass", "pass", "pass")
    assert judged(left(nis=1.2)) == ("fail", "pass", "pass")
    assert judged(left(nis=0.8)) == ("fail", "pass", "pass")
    assert judged(left(p=0.04)) == ("pass", "fail", "pass")
    assert judged(left(outside=0.2)) == ("pass", "pass", "fail")


def test_words_name_the_channels() -> None:
    assert consistency_words({"u": left(), "v": left()}).startswith("Yes")
    told = consistency_words({"u": left(outside=0.5), "v": left(), "r": left(nis=2.0)})
    assert "the errors of u are correlated" in told and "Those of r do not have" in told
    assert consistency_words({}) == ""


def test_words_say_no_where_any_test_of_the_table_fails() -> None:
    """Nor do they speak of held-out maneuvers where nothing was held out."""
    told = consistency_words({"u": left(), "v": left(p=0.01)})
    assert told == "Not entirely: the errors of v are not normally distributed."
    told = consistency_words({"u": left(nis=2.0, p=0.01)})
    assert told.startswith("Not entirely: the errors of u do not have the size")
    assert "Those of u are not normally" in told
    assert "held-out" in consistency_words({"u": left()})
    assert "used for identification" in consistency_words({"u": left()}, "identify")


def test_the_figure_says_pass_or_fail_and_draws_every_lag() -> None:
    time = np.arange(0.0, 20.0, 0.1)
    rng = np.random.default_rng(2)
    table = pd.DataFrame(
        {
            "maneuver": "turn-1",
            "role": "validate",
            "time_s": time,
            "u_mps_measured": 1.5 + 0.01 * rng.standard_normal(len(time)),
            "u_mps_simulated": 1.5,
        }
    )
    with style():
        drawn = innovations(table, {"u": left(outside=0.2)}, "validate", "one")
        assert innovations(table, {"u": left()}, "identify", "none") is None
        assert innovations(table, {}, "validate", "none") is None
    assert drawn is not None
    assert "size pass: NIS 1" in drawn and "white fail: 20 % of the lags outside" in drawn
    (label,) = re.findall(r'aria-label="([^"]*)"', drawn)
    assert label.endswith("u: size pass, white fail")


def test_panels_of_one_time_and_of_one_lag_stand_above_each_other() -> None:
    """However long their numbers are: the axis below the last one is that of all."""
    time = np.arange(0.0, 20.0, 0.1)
    noise = np.random.default_rng(2).standard_normal(len(time))
    table = pd.DataFrame({"maneuver": "turn-1", "role": "validate", "time_s": time})
    for column, size in (("u_mps", 0.001), ("v_mps", 0.001), ("r_radps", 1.0)):
        table[f"{column}_measured"] = size * noise
        table[f"{column}_simulated"] = 0.0
    unknown = left().model_copy(update={"autocorrelation": None})
    tests = {"u": left(), "v": unknown, "r": left()}
    with style():
        drawn = innovations(table, tests, "validate", "one")
    assert drawn is not None
    stacks = re.findall(r'<div class="stack".*?(?=<div class="stack"|$)', drawn, re.DOTALL)
    assert [s.count('class="panel"') for s in stacks] == [3, 3]
    assert [s.count('class="head"') for s in stacks] == [3, 3]  # rows of one height
