"""Numbers and times as people and programs write them."""

import numpy as np
import pandas as pd
import pytest
from log_world import wide_table

from auvident.errors import InputError
from auvident.schema.logs import ColumnMap
from auvident.storage.log_inspect import inspect_log
from auvident.storage.logs import read_trials

SENSORS = ("dvl", "gyro", "rudder", "rpm")
STARTED = pd.Timestamp("2024-05-01T12:00:00")


def read(path, table, column_map=None, **how):
    table.to_csv(path, index=False, **how)
    (trial,) = read_trials([path], column_map)
    return trial


def with_time(name, values):
    table = wide_table().drop(columns="time_s")
    table.insert(0, name, values)
    return table


def instants():
    return STARTED + pd.to_timedelta(wide_table()["time_s"], unit="s")


def same(trial, time_s=None):
    """Whether the readings are those of the small log, in its order, at its times."""
    expected = wide_table()
    for sensor in SENSORS:
        own = trial.sensors[sensor]
        apart = np.diff(expected["time_s"] if time_s is None else time_s)
        np.testing.assert_allclose(np.diff(own.time_s), apart, atol=1e-6)
    np.testing.assert_array_equal(trial.sensors["dvl"].values["u_mps"], expected["u_mps"])


# --- numbers ------------------------------------------------------------------------------


@pytest.mark.parametrize("delimiter", [",", ";", "\t"])
def test_a_comma_between_thousands_is_no_decimal_one(tmp_path, delimiter):
    table = wide_table()
    rpm = np.linspace(0.0, 1500.0, len(table)).round()
    table["rpm"] = [f"{value:,.0f}" for value in rpm]
    trial = read(tmp_path / "run.csv", table, sep=delimiter)
    np.testing.assert_array_equal(trial.sensors["rpm"].values["rpm"], rpm)
    same(trial)


def german(value, digits):
    """A number as spreadsheets in Germany write it: 1.170,5."""
    return f"{value:,.{digits}f}".translate(str.maketrans(",.", ".,"))


@pytest.mark.parametrize("digits", [0, 1])
@pytest.mark.parametrize("delimiter", [";", "\t"])
def test_a_point_between_thousands_is_no_decimal_one(tmp_path, delimiter, digits):
    """An rpm of 1.170 was 1.17 in a file of decimal commas, and nothing said so."""
    table = wide_table()
    rpm = np.linspace(0.0, 1500.0, len(table)).round(digits)
    texts = table.map(lambda value: f"{value:.4f}".replace(".", ","))
    texts["rpm"] = [german(value, digits) for value in rpm]
    trial = read(tmp_path / "run.csv", texts, sep=delimiter)
    np.testing.assert_allclose(trial.sensors["rpm"].values["rpm"], rpm)
    same(trial)


def test_a_decimal_point_beside_decimal_commas_stays_one(tmp_path):
    """Of a column of its own, as of another program: with three decimals throughout, or others."""
    table = wide_table()
    for rpm in (np.linspace(1.125, 9.375, len(table)).round(3), np.full(len(table), 0.125)):
        texts = table.map(lambda value: f"{value:.4f}".replace(".", ","))
        texts["rpm"] = [f"{value:.3f}" for value in rpm]
        trial = read(tmp_path / "run.csv", texts, sep=";")
        np.testing.assert_allclose(trial.sensors["rpm"].values["rpm"], rpm)


def test_decimal_commas_within_quotes_are_decimal_ones(tmp_path):
    table = wide_table()
    texts = table.map(lambda value: f"{value:.3f}".replace(".", ","))
    trial = read(tmp_path / "run.csv", texts)
    np.testing.assert_allclose(trial.sensors["rpm"].values["rpm"], table["rpm"])
    np.testing.assert_allclose(trial.sensors["dvl"].values["u_mps"], table["u_mps"], atol=6e-4)
    mixed = table.assign(rpm=[f"{value:.2f}".replace(".", ",") for value in 1.125 * table["rpm"]])
    trial = read(tmp_path / "mixed.csv", mixed)
    np.testing.assert_allclose(trial.sensors["rpm"].values["rpm"], 1.125 * table["rpm"])


@pytest.mark.parametrize(
    "word", ["1.#QNAN", "-1.#IND", "1.#INF", "#DIV/0!", "#VALUE!", "<NA>", "n.a.", "missing", "*"]
)
def test_words_for_no_number_are_empty_cells(tmp_path, word):
    table = wide_table().astype(object)
    table.loc[[5, 17], "u_mps"] = word
    trial = read(tmp_path / "run.csv", table)
    assert np.flatnonzero(np.isnan(trial.sensors["dvl"].values["u_mps"])).tolist() == [5, 17]


# --- times --------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "how",
    ["%Y-%m-%d %H:%M:%S.%f UTC", "%Y-%m-%dT%H:%M:%S.%fGMT", "%d-%b-%Y %H:%M:%S.%f"],
)
def test_instants_with_utc_as_a_word_and_months_by_name(tmp_path, how):
    trial = read(tmp_path / "run.csv", with_time("timestamp", instants().dt.strftime(how)))
    same(trial)
    assert trial.origin == "2024-05-01T12:00:00Z"


def test_other_names_of_zones_are_refused(tmp_path):
    table = with_time("timestamp", instants().dt.strftime("%Y-%m-%d %H:%M:%S.%f CEST"))
    with pytest.raises(InputError, match="is not an ISO 8601 time"):
        read(tmp_path / "run.csv", table)


@pytest.mark.parametrize("period", [86400.0, 604800.0])
def test_seconds_of_a_day_or_a_week_go_on_past_its_end(tmp_path, period):
    time = (wide_table()["time_s"] + period - 12.35) % period
    trial = read(tmp_path / "run.csv", with_time("time_s", time.round(3)))
    same(trial)
    assert trial.sensors["dvl"].time_s[0] == pytest.approx(period - 12.35)


def test_a_clock_that_is_set_back_does_not_go_on(tmp_path):
    time = wide_table()["time_s"].to_numpy(copy=True) + 80070.0
    time[150:] -= 80070.0  # switched on again
    trial = read(tmp_path / "run.csv", with_time("time_s", time))
    assert np.diff(trial.sensors["dvl"].time_s).min() < -80000.0


@pytest.mark.parametrize(
    ("name", "factor"),
    [("Mission time [ms]", 1e3), ("t (us)", 1e6), ("Elapsed [seconds]", 1.0), ("Zeit [s]", 1.0)],
)
def test_the_label_of_a_time_is_its_unit(tmp_path, name, factor):
    table = with_time(name, (factor * wide_table()["time_s"]).round(3))
    plain = name.partition(" [")[0].partition(" (")[0]
    column_map = ColumnMap.model_validate({s: {"time": plain} for s in SENSORS})
    same(read(tmp_path / "run.csv", table, column_map))
    assert f'time = "{plain}"' in inspect_log(tmp_path / "run.csv").proposed_map


@pytest.mark.parametrize(("name", "told"), [("time_s [min]", "in min"), ("time_s [ms]", "'ms'")])
def test_a_label_of_another_unit_is_refused(tmp_path, name, told):
    with pytest.raises(InputError, match=told):
        read(tmp_path / "run.csv", with_time(name, wide_table()["time_s"]))
    assert told in " ".join(inspect_log(tmp_path / "run.csv").files[0].notes)


def test_the_map_has_the_last_word_on_the_unit(tmp_path):
    table = with_time("time_s [ms]", wide_table()["time_s"])
    same(read(tmp_path / "run.csv", table, ColumnMap.model_validate({"time_unit": "s"})))


def test_a_header_and_its_units_written_again_are_left_out(tmp_path):
    names, *rows = wide_table().to_csv(index=False).splitlines()
    units = "s,m/s,m/s,rad/s,deg,rpm"
    lines = [names, units, *rows[:100], names, units, *rows[100:]]
    (tmp_path / "run.csv").write_text("\n".join(lines))
    (trial,) = read_trials([tmp_path / "run.csv"])
    same(trial)
    assert trial.sensors["dvl"].dropped == {"repeated_header": 2}


@pytest.mark.parametrize("again", [str.upper, lambda names: names.replace("u_mps", "u_mps [m/s]")])
def test_a_header_written_again_in_other_letters_or_with_units_is_left_out(tmp_path, again):
    names, *rows = wide_table().to_csv(index=False).splitlines()
    lines = [names, *rows[:100], again(names), *rows[100:]]
    (tmp_path / "run.csv").write_text("\n".join(lines))
    (trial,) = read_trials([tmp_path / "run.csv"])
    same(trial)
    assert trial.sensors["dvl"].dropped == {"repeated_header": 1}


def test_columns_that_change_places_are_told_with_what_to_do(tmp_path):
    """To remove the row, as was advised, would have put v into u from there on."""
    table = wide_table()
    other = table[["time_s", "v_mps", "u_mps", *table.columns[3:]]][150:].to_csv(index=False)
    (tmp_path / "run.csv").write_text(table[:150].to_csv(index=False) + other)
    with pytest.raises(InputError, match="in another order") as caught:
        read_trials([tmp_path / "run.csv"])
    assert caught.value.where.endswith("run.csv, row 152")
    assert "file of its own" in (caught.value.remedy or "")
    more = table[150:].assign(battery_v=24.0).to_csv(index=False)
    (tmp_path / "run.csv").write_text(table[:150].to_csv(index=False) + more)
    with pytest.raises(InputError, match="fields of the header") as caught:
        read_trials([tmp_path / "run.csv"])
    assert "file of its own" in (caught.value.remedy or "")
