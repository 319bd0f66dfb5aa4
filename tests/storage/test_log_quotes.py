"""A quote that does not close on its line costs that line and no other."""

import gzip

import numpy as np
import pytest
from log_world import wide_table

from auvident.errors import InputError
from auvident.storage.logs import read_trials

ROWS = len(wide_table())


def lines() -> list[str]:
    return wide_table().to_csv(index=False).split("\n")[:-1]


def with_quote(number: int, field: int, place: str = "before") -> list[str]:
    """The file with one quote in a field of a line (1-based)."""
    found = lines()
    fields = found[number - 1].split(",")
    text = fields[field]
    middle = len(text) // 2 or 1
    fields[field] = {
        "before": '"' + text,
        "after": text + '"',
        "inside": text[:middle] + '"' + text[middle:],
    }[place]
    found[number - 1] = ",".join(fields)
    return found


def write(path, text: str):
    path.write_bytes(gzip.compress(text.encode()) if path.suffix == ".gz" else text.encode())
    return path


def gyro(path):
    (trial,) = read_trials([path])
    return trial.sensors["gyro"]


def assert_one_line_lost(path, number: int) -> None:
    found = gyro(path)
    assert found.rows_read == ROWS
    assert found.dropped == {"stray_quote": 1}
    assert found.dropped_rows == {"stray_quote": (number,)}
    expected = np.delete(wide_table()["r_radps"].to_numpy(), number - 2)
    np.testing.assert_allclose(found.values["r_radps"], expected, atol=1e-12)
    np.testing.assert_array_equal(found.rows, np.delete(np.arange(2, ROWS + 2), number - 2))


@pytest.mark.parametrize("number", [2, 3, ROWS // 2, ROWS, ROWS + 1])
@pytest.mark.parametrize("field", [0, 2, 5])
@pytest.mark.parametrize("place", ["before", "inside", "after"])
def test_one_stray_quote_costs_its_line(tmp_path, number, field, place):
    text = "\n".join(with_quote(number, field, place)) + "\n"
    assert_one_line_lost(write(tmp_path / "run.csv", text), number)


@pytest.mark.parametrize("ending", ["run.csv", "run.csv.gz"])
@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
@pytest.mark.parametrize("delimiter", [",", ";", "\t", " "])
def test_in_every_dialect(tmp_path, ending, end, delimiter):
    text = end.join(with_quote(40, 3)).replace(",", delimiter) + end
    assert_one_line_lost(write(tmp_path / ending, text), 40)


def test_two_quotes_far_apart_cost_two_lines(tmp_path):
    found = lines()
    found[20] = '"' + found[20]
    found[200] = found[200].replace(",", ',"', 1)
    sensor = gyro(write(tmp_path / "run.csv", "\n".join(found) + "\n"))
    assert sensor.dropped == {"stray_quote": 2}
    assert sensor.dropped_rows == {"stray_quote": (21, 201)}
    assert sensor.values["r_radps"].size == ROWS - 2


def test_a_stray_quote_in_the_last_line_without_an_end(tmp_path):
    sensor = gyro(write(tmp_path / "run.csv", "\n".join(with_quote(ROWS + 1, 2))))
    assert sum(sensor.dropped.values()) == 1
    assert sensor.values["r_radps"].size == ROWS - 1


@pytest.mark.parametrize("field", [0, 3, 5])
@pytest.mark.parametrize("place", ["before", "after"])
def test_a_stray_quote_among_the_names_costs_nothing(tmp_path, field, place):
    sensor = gyro(write(tmp_path / "run.csv", "\n".join(with_quote(1, field, place)) + "\n"))
    assert sensor.values["r_radps"].size == ROWS
    assert sensor.dropped == {}


def test_quoted_names_and_values_are_as_without_quotes(tmp_path):
    quoted = [",".join(f'"{word}"' for word in line.split(",")) for line in lines()]
    plain = gyro(write(tmp_path / "plain.csv", "\n".join(lines()) + "\n"))
    sensor = gyro(write(tmp_path / "run.csv", "\r\n".join(quoted) + "\r\n"))
    assert sensor.dropped == {}
    np.testing.assert_array_equal(sensor.values["r_radps"], plain.values["r_radps"])
    np.testing.assert_array_equal(sensor.rows, plain.rows)


def test_a_quoted_line_with_a_stray_quote(tmp_path):
    quoted = [",".join(f'"{word}"' for word in line.split(",")) for line in lines()]
    quoted[49] = quoted[49].replace('","', '",""', 1)
    assert_one_line_lost(write(tmp_path / "run.csv", "\n".join(quoted) + "\n"), 50)


def test_decimal_commas_in_quotes_stay_one_value(tmp_path):
    quoted = [lines()[0]] + [
        ",".join(f'"{word.replace(".", ",")}"' for word in line.split(",")) for line in lines()[1:]
    ]
    quoted[29] = quoted[29][:-1]
    assert_one_line_lost(write(tmp_path / "run.csv", "\n".join(quoted) + "\n"), 30)


def test_remarks_with_inch_marks_cost_nothing(tmp_path):
    found = [line + (',5" gun' if k else ",note") for k, line in enumerate(lines())]
    sensor = gyro(write(tmp_path / "run.csv", "\n".join(found) + "\n"))
    assert sensor.dropped == {}
    assert sensor.values["r_radps"].size == ROWS


def test_quotes_in_comments_are_not_counted(tmp_path):
    found = lines()
    found[30:30] = ['# the skipper said: "slower', '# 12" of swell, "stop']
    sensor = gyro(write(tmp_path / "run.csv", "\n".join(found) + "\n"))
    assert "stray_quote" not in sensor.dropped
    assert sensor.values["r_radps"].size == ROWS


def test_quotes_all_over_are_refused(tmp_path):
    found = [line.replace(",", ',"', 1) if k % 5 == 1 else line for k, line in enumerate(lines())]
    path = write(tmp_path / "run.csv", "\n".join(found) + "\n")
    with pytest.raises(InputError) as caught:
        read_trials([path])
    for word in (str(path), "row 2", "60 rows", "quote"):
        assert word in str(caught.value)
    assert caught.value.remedy
