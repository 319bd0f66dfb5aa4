"""A log that is read in blocks gives what it gives as a whole, whatever is wrong with it."""

import gzip

import numpy as np
import pytest
from log_world import wide_table

from auvident.errors import InputError
from auvident.storage import log_blocks, log_csv
from auvident.storage.log_file import open_log, read_log

ROWS = 3000
WANTED = dict.fromkeys(("time_s", "u_mps", "rudder_deg"))


def lines() -> list[str]:
    """A header and rows at 10 Hz."""
    table = wide_table()
    whole = table.loc[np.arange(ROWS) % len(table)].reset_index(drop=True)
    whole["time_s"] = np.round(np.arange(ROWS) / 10.0, 3)
    return whole.to_csv(index=False).splitlines()


def changed(place: int, change) -> list[str]:
    rows = lines()
    rows[place] = change(rows[place])
    return rows


def with_rows(*places: int, row: str) -> list[str]:
    rows = lines()
    for place in sorted(places, reverse=True):
        rows.insert(place, row)
    return rows


FILES = {
    "well formed": "\n".join(lines()) + "\n",
    "no last line end": "\n".join(lines()),
    "cut off in the last row": "\n".join(lines())[:-12],
    "cut off in the last digit": "\n".join(lines())[:-1] + ".",
    "line ends of Windows": "\r\n".join(lines()) + "\r\n",
    "line ends of old": "\r".join(lines()) + "\r",
    "empty cells": "\n".join(changed(1500, lambda x: x.split(",")[0] + ",,,,,")) + "\n",
    "missing values": "\n".join(changed(1500, lambda x: x.split(",")[0] + ",nan,-,1,n/a,2")) + "\n",
    "blank lines": "\n".join(with_rows(700, 1900, 2999, row="")) + "\n\n",
    "a comment": "\n".join(with_rows(1400, row="# event, surfaced")) + "\n",
    "a header again": "\n".join(with_rows(1400, row=lines()[0])) + "\n",
    "ragged rows": "\n".join(with_rows(400, 2200, row="1,2")) + "\n",
    "many ragged rows": "\n".join(with_rows(*range(5, 2900, 40), row="1,2")) + "\n",
    "a stray quote": "\n".join(changed(2100, lambda x: x.replace(",", ',"', 1))) + "\n",
    "many stray quotes": "\n".join(x.replace(",", ',"', 1) for x in lines()) + "\n",
    "text among the numbers": "\n".join(changed(2100, lambda x: x.replace(",", ",oops", 1))) + "\n",
    "semicolons": "\n".join(lines()).replace(",", ";") + "\n",
    "decimal commas late": "\n".join(lines()[:1500]).replace(",", ";")
    + "\n"
    + "\n".join(lines()[1500:]).replace(",", ";").replace(".", ","),
    "other characters": "\n".join(changed(1200, lambda x: x + "°")) + "\n",
    "zero bytes at the end": "\n".join(lines()) + "\n\0\0\0\0",
    "nothing but a header": lines()[0] + "\n",
}


def outcome(path) -> tuple:
    """What reading gives, or how it is refused."""
    try:
        table = read_log(open_log(path), WANTED)
    except InputError as error:
        return (str(error),)
    values = {name: x.tolist() for name, x in table.columns.items()}
    rows = tuple(table.rows.tolist())
    return repr(values), rows, table.rows_read, table.dropped, table.dropped_rows


@pytest.mark.parametrize("block", [4_000, 37_000])
@pytest.mark.parametrize("name", FILES)
def test_in_blocks_as_a_whole(tmp_path, monkeypatch, name, block):
    path = tmp_path / "log.csv"
    path.write_bytes(FILES[name].encode())
    whole = outcome(path)
    for module in (log_blocks, log_csv):
        monkeypatch.setattr(module, "BLOCK_BYTES", block)
    monkeypatch.setattr(log_csv, "PEEK_ROWS", 20)
    assert outcome(path) == whole


@pytest.mark.parametrize("share", [1.0, 0.6])
def test_compressed_and_cut(tmp_path, monkeypatch, share):
    packed = gzip.compress(FILES["well formed"].encode(), mtime=0)
    path = tmp_path / "log.csv.gz"
    path.write_bytes(packed[: int(share * len(packed))])
    whole = outcome(path)
    for module in (log_blocks, log_csv):
        monkeypatch.setattr(module, "BLOCK_BYTES", 4_000)
    assert outcome(path) == whole


@pytest.mark.parametrize("name", ["well formed", "line ends of Windows", "a comment"])
def test_a_long_log_is_never_in_memory_as_a_whole(tmp_path, monkeypatch, name):
    """Also with damage here and there: the tests above would pass without blocks as well."""

    def refuse(*_):
        raise AssertionError("read as a whole")

    path = tmp_path / "log.csv"
    path.write_bytes(FILES[name].encode())
    for module in (log_blocks, log_csv):
        monkeypatch.setattr(module, "BLOCK_BYTES", 37_000)
    monkeypatch.setattr(log_csv, "_body", refuse)
    assert len(outcome(path)) > 1


def test_row_numbers_are_narrow_until_they_do_not_fit():
    last = np.iinfo(np.int32).max
    np.testing.assert_array_equal(log_csv.numbered(2, 3), [2, 3, 4])
    assert log_csv.numbered(2, 3).dtype == np.int32
    np.testing.assert_array_equal(log_csv.numbered(last - 1, 3), [last - 1, last, last + 1])
