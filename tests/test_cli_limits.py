"""Options and commands that look things up, on what is no sound input."""

import pytest
from click.testing import CliRunner

from auvident.cli.common import parse_limits
from auvident.cli.tables import inspect
from auvident.errors import InputError, UsageError


@pytest.mark.parametrize("text", ["u=nan", "u=-1", "u=0", "u=inf", "u=", "=1", "u"])
def test_a_limit_that_no_error_can_be_held_against_is_refused(text):
    with pytest.raises(UsageError, match="a number above 0"):
        parse_limits((text,))


def test_a_limit_is_read():
    assert parse_limits(("u=0.05", "r = 1e-3")) == {"u": 0.05, "r": 1e-3}


@pytest.mark.parametrize("content", [b"", b"%% LOGSTART 2024-05-01\n1.0 X iX 3\n"])
def test_inspect_refuses_a_file_of_which_nothing_can_be_read(tmp_path, content):
    path = tmp_path / "a.alog"
    path.write_bytes(content)
    told = CliRunner().invoke(inspect, [str(path)])
    assert isinstance(told.exception, InputError)
    assert told.exception.remedy


def test_inspect_does_not_call_a_log_sound_of_which_a_file_is_damaged(tmp_path):
    (tmp_path / "gyro.csv").write_text("time_s,r_degps\n0,1\n1,2\n2,3\n")
    (tmp_path / "dvl.csv").write_bytes(b"")
    told = CliRunner().invoke(inspect, [str(tmp_path)])
    assert told.exit_code == 0
    assert "without a map" not in told.output
    assert "1 of 2 files cannot be read" in told.output
