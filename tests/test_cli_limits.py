"""Options and commands that look things up, on what is no sound input."""

from pathlib import Path

import pandas as pd
import pytest
from click.testing import CliRunner

from auvident.cli.common import PATH, parse_limits
from auvident.cli.tables import inspect, new_vehicle
from auvident.errors import InputError, UsageError


@pytest.mark.parametrize("text", ["u=nan", "u=-1", "u=0", "u=inf", "u=", "=1", "u"])
def test_a_limit_that_no_error_can_be_held_against_is_refused(text):
    with pytest.raises(UsageError, match="a number above 0"):
        parse_limits((text,))


def test_a_limit_is_read():
    assert parse_limits(("u=0.05", "r = 1e-3")) == {"u": 0.05, "r": 1e-3}


def test_whether_a_path_may_be_read_is_not_asked_by_the_command_line(tmp_path, monkeypatch):
    """Its refusal would be a matter of usage (code 2), and name neither cause nor remedy."""
    monkeypatch.setattr("os.access", lambda *_, **__: False)
    (tmp_path / "v.toml").write_text("")
    assert PATH.convert(str(tmp_path / "v.toml"), None, None) == tmp_path / "v.toml"
    assert PATH.convert(str(tmp_path), None, None) == tmp_path


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


SOUND = "time_s,u_mps,v_mps,r_degps,rudder_deg,rpm\n"
FOREIGN = "t,surge,sway,yaw_rate,delta_cmd,n_prop\n"


def log_with(path: Path, header: str) -> Path:
    """A wide log of a minute and a half."""
    rows = (f"{k / 10},1.5,{k % 7 / 100},{k % 5},{k % 3},{900 + k % 2}\n" for k in range(900))
    path.write_text(header + "".join(rows))
    return path


@pytest.mark.parametrize("header", [SOUND, FOREIGN])
@pytest.mark.parametrize("there", ["trial.csv", "map.toml"])
def test_inspect_overwrites_nothing(tmp_path, header, there):
    """Neither the log itself, nor a map that somebody has edited."""
    log = log_with(tmp_path / "trial.csv", header)
    (tmp_path / "map.toml").write_text("# edited\n")
    content = (tmp_path / there).read_bytes()
    told = CliRunner().invoke(inspect, [str(log), "--output", str(tmp_path / there)])
    assert isinstance(told.exception, UsageError)
    assert told.exception.problem == "exists already"
    assert (tmp_path / there).read_bytes() == content


@pytest.mark.parametrize(("header", "is_written"), [(SOUND, False), (FOREIGN, True)])
def test_inspect_writes_a_map_only_where_it_proposes_one(tmp_path, header, is_written):
    file = tmp_path / "map.toml"
    log = log_with(tmp_path / "trial.csv", header)
    told = CliRunner().invoke(inspect, [str(log), "--output", str(file)])
    assert told.exit_code == 0
    assert file.exists() == is_written
    assert ("map.toml was not written" in told.output) != is_written


@pytest.mark.parametrize("arguments", [[], ["LOG"]])
def test_a_device_may_be_written_to(tmp_path, arguments):
    log = log_with(tmp_path / "trial.csv", FOREIGN)
    command = inspect if arguments else new_vehicle
    told = CliRunner().invoke(command, [str(log)] * len(arguments) + ["--output", "/dev/null"])
    assert told.exit_code == 0


def with_another_time(case: str, log: pd.DataFrame) -> pd.DataFrame:
    """A log whose rows or time stamps no trial can have."""
    if case == "reversed":
        return log[::-1]
    if case == "shuffled":
        return log.sample(frac=1.0, random_state=0)
    if case == "days":
        return log.assign(time_s=45_000.0 + log["time_s"] / 86_400)
    stamps = pd.to_datetime(1.7e9 + log["time_s"], unit="s").dt.strftime("%m/%d/%Y %H:%M:%S.%f")
    return log.drop(columns="time_s").assign(timestamp=stamps.str[:-3])


@pytest.mark.parametrize("case", ["reversed", "shuffled", "days", "of the US"])
def test_inspect_does_not_call_a_log_sound_whose_time_cannot_be_used(tmp_path, case):
    log = log_with(tmp_path / "trial.csv", SOUND)
    with_another_time(case, pd.read_csv(log)).to_csv(log, index=False)
    told = CliRunner().invoke(inspect, [str(log)])
    assert told.exit_code == 0
    assert "without a map" not in told.output
    assert "it cannot be read as it is" in told.output


def test_inspect_does_not_call_a_log_sound_that_runs_on_two_clocks(tmp_path):
    table = pd.read_csv(log_with(tmp_path / "trial.csv", SOUND))
    folder = tmp_path / "run"
    folder.mkdir()
    columns = {"dvl": ["u_mps", "v_mps"], "gyro": ["r_degps"], "rudder": ["rudder_deg"]}
    for sensor, names in {**columns, "rpm": ["rpm"]}.items():
        table[["time_s", *names]].to_csv(folder / f"{sensor}.csv", index=False)
    assert "can be read as it is" in CliRunner().invoke(inspect, [str(folder)]).output
    stamps = pd.to_datetime(1.7e9 + table["time_s"], unit="s").astype(str)
    pd.DataFrame({"timestamp": stamps, "rpm": 900.0}).to_csv(folder / "rpm.csv", index=False)
    told = CliRunner().invoke(inspect, [str(folder)]).output
    assert "it cannot be read as it is" in told
    assert "different clocks" in told


def test_inspect_names_a_file_that_would_be_set_aside(tmp_path):
    """Of a sensor that no trial needs: the log is read, but not all of it."""
    log_with(tmp_path / "dvl.csv", SOUND)
    rows = "".join(f"06/01/2024 12:04:{k:02d},{k}\n" for k in range(50))
    (tmp_path / "attitude.csv").write_text("timestamp,heading_deg\n" + rows)
    told = CliRunner().invoke(inspect, [str(tmp_path)]).output
    assert "it cannot be read as it is" in told
    assert "attitude.csv was not used" in told
