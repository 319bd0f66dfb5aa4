"""Hostile names, options and outputs at the command line; what is left over is one line."""

import errno
import os
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

import pytest

from auvident.cli import failures
from tests.command_line import ENVIRONMENT, SAMPLES, Called

VEHICLE = (SAMPLES / "remus100.toml").read_text()
COMMAND = [sys.executable, "-m", "auvident"]
NAMES = {
    "escape sequence": "\\u001b[31mred\\u001b]0;title\\u0007",
    "control characters": "\\u009b31m\\b\\r",
    "right to left": "\\u202eabc",
    "line": "a\\nError: b",
}
MARKUP = ("[/dev] [red]x[/]", ":smile: \N{GRINNING FACE}", "<b>&amp;", r"\\[bold]")


def vehicle_named(folder: Path, name: str) -> Path:
    path = folder / "v.toml"
    path.write_text(re.sub(r'name = ".*"', lambda _: f'name = "{name}"', VEHICLE, count=1))
    return path


def is_printable(text: str) -> bool:
    return all(c.isprintable() or c in "\n\t" for c in text)


@pytest.mark.parametrize("name", NAMES)
def test_no_name_gives_orders_to_the_terminal(
    tmp_path: Path, auvident: Callable[..., Called], name: str
) -> None:
    called = auvident("ase", "--vehicle", vehicle_named(tmp_path, NAMES[name]))
    assert called.code == 0, called.err
    assert is_printable(called.err + called.out)


@pytest.mark.parametrize("name", MARKUP)
def test_a_name_with_markup_is_shown_as_it_is(
    tmp_path: Path, auvident: Callable[..., Called], name: str
) -> None:
    called = auvident("ase", "--vehicle", vehicle_named(tmp_path, name))
    assert called.code == 0, called.err
    assert name.replace("\\\\", "\\") in called.err


ORDERS = "\x1b[31mred\x07"


@pytest.mark.parametrize("words", [("status",), (), ("inspect",), ("simulate", "run", "--rate")])
def test_no_argument_gives_orders_to_the_terminal(
    auvident: Callable[..., Called], words: tuple[str, ...]
) -> None:
    called = auvident(*words, ORDERS)
    assert called.code in (2, 3, 4)
    assert is_printable(called.err)
    assert "[31mred" in called.err


def test_an_endless_argument_is_shortened(auvident: Callable[..., Called]) -> None:
    called = auvident("ase", "--vehicle", "x/" * 20_000)
    assert called.code == 3
    assert len(called.err) < 5000
    assert "characters" in called.err


PATHS = [
    ("status",),
    ("inspect",),
    ("export",),
    ("ase", "--vehicle"),
    ("ingest", "log", "--vehicle", "v.toml", "--run"),
    ("simulate", "run", "--inputs", "log", "--map"),
]


@pytest.mark.parametrize("words", PATHS)
@pytest.mark.parametrize(("path", "why"), [("", "empty"), ("\udcff\udcfe.toml", "not UTF-8")])
def test_paths_that_are_none_are_wrong_usage(
    auvident: Callable[..., Called], words: tuple[str, ...], path: str, why: str
) -> None:
    called = auvident(*words, path)
    assert called.code == 2, called.err
    assert why in called.err


OPTIONS = [
    ("simulate", "run", "--inputs", "log", "--samples", "1000000000"),
    ("simulate", "run", "--inputs", "log", "--samples", "1e9"),
    ("simulate", "run", "--inputs", "log", "--seed", "-1"),
    ("run", "log", "--vehicle", "v.toml", "--run", "run", "--seed", "-1"),
    ("diagnose", "run", "--seed", "9" * 400),
]


@pytest.mark.parametrize("words", OPTIONS, ids=lambda words: " ".join(words[-2:])[:20])
def test_huge_options_are_wrong_usage(
    auvident: Callable[..., Called], words: tuple[str, ...]
) -> None:
    called = auvident(*words)
    assert called.code == 2, called.err
    assert words[-2] in called.err


@pytest.fixture
def fails(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Callable[[BaseException], None]:
    """Makes `auvident coefficients` fail; crash files go to the test's folder."""
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))

    def with_error(error: BaseException) -> None:
        def fail(*_: object, **__: object) -> None:
            raise error

        monkeypatch.setattr("auvident.cli.common.Output.text", fail)

    return with_error


def test_a_bug_is_one_line_and_a_file_to_send(
    fails: Callable, auvident: Callable[..., Called], tmp_path: Path
) -> None:
    fails(TypeError("not \x1b[31m foreseen"))
    called = auvident("coefficients")
    assert called.code == failures.BUG_EXIT_CODE == 70
    assert "Traceback" not in called.err
    assert is_printable(called.err)
    (crash,) = tmp_path.glob("auvident-crash-*.txt")
    assert str(crash) in called.err
    for words in ("Traceback", "TypeError", "auvident 0.", "Python 3.", "numpy ", "coefficients"):
        assert words in crash.read_text()


def test_a_bug_has_its_traceback_with_verbose(
    fails: Callable, auvident: Callable[..., Called]
) -> None:
    fails(TypeError("not foreseen"))
    assert "Traceback" in auvident("coefficients", "--verbose").err


def test_a_bug_without_room_for_a_file_is_still_told(
    fails: Callable, auvident: Callable[..., Called], monkeypatch: pytest.MonkeyPatch
) -> None:
    fails(TypeError("not foreseen"))
    monkeypatch.setattr(tempfile, "tempdir", "/nonesuch")
    called = auvident("coefficients")
    assert called.code == 70
    assert "--verbose" in called.err


@pytest.mark.parametrize(
    ("error", "words"),
    [
        (PermissionError(13, "Permission denied", "a/b.csv"), ("a/b.csv", "Permission denied")),
        (OSError(36, "File name too long", "x" * 5000), ("File name too long",)),
        (OSError(28, "No space left on device"), ("standard output", "No space left")),
        (MemoryError(), ("memory",)),
    ],
)
def test_what_the_system_refuses_is_no_bug(
    fails: Callable, auvident: Callable[..., Called], error: Exception, words: tuple[str, ...]
) -> None:
    fails(error)
    called = auvident("coefficients")
    assert called.code == 3, called.err
    assert "bug" not in called.err
    for word in words:
        assert word in called.err


@pytest.mark.parametrize("words", [("coefficients",), ("effects", "--json")])
def test_a_full_disk_under_standard_output(words: tuple[str, ...]) -> None:
    with open("/dev/full", "w") as full:
        done = subprocess.run(
            [*COMMAND, *words], env=ENVIRONMENT, stdout=full, stderr=subprocess.PIPE, text=True
        )
    assert done.returncode == 3, done.stderr
    assert done.stderr.startswith("Error: standard output")
    assert len(done.stderr.splitlines()) == 2


def test_a_reader_that_leaves_is_no_error() -> None:
    command = " ".join([*COMMAND, "effects", "--json"])
    script = f"set -o pipefail; {command} | head -c 10"
    done = subprocess.run(["bash", "-c", script], env=ENVIRONMENT, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.parametrize("unbuffered", ["", "1"])
@pytest.mark.parametrize("words", ["effects", "effects --json", "run --help", "schema model"])
def test_a_reader_that_is_gone_before_the_first_line_is_no_gate(
    words: str, unbuffered: str
) -> None:
    """Click ends with code 1 by a broken pipe, which is that of a gate that is not met."""
    script = f"{shlex.join(COMMAND)} {words} | true; exit ${{PIPESTATUS[0]}}"
    environment = {**ENVIRONMENT, "PYTHONUNBUFFERED": unbuffered}
    done = subprocess.run(["bash", "-c", script], env=environment, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.parametrize(("limit", "code"), [("r=9", 0), ("r=1e-6", 1)])
def test_a_gate_is_judged_when_nobody_reads_any_more(demo: Path, limit: str, code: int) -> None:
    validate = shlex.join([*COMMAND, "validate", str(demo), "--fail-above", limit])
    for piped in (f"{validate} --json | true", f"{validate} --json 2>&1 | true"):
        script = f"{piped}; exit ${{PIPESTATUS[0]}}"
        done = subprocess.run(["bash", "-c", script], env=ENVIRONMENT)
        assert done.returncode == code


@pytest.mark.parametrize("closed", [">&-", "2>&-", ">&- 2>&-", "<&- >&- 2>&-"])
def test_a_stream_that_is_closed_from_the_start_is_no_error(closed: str, demo: Path) -> None:
    """As of a service without a terminal: code 1 with a traceback, or without a word."""
    for words, code in ((["coefficients"], 0), (["validate", str(demo), "--fail-above=r=1e-6"], 1)):
        script = f"{shlex.join([*COMMAND, *words])} {closed}"
        done = subprocess.run(
            ["bash", "-c", script], env=ENVIRONMENT, capture_output=True, text=True
        )
        assert done.returncode == code
        assert "bug" not in done.stderr and "Traceback" not in done.stderr


def test_another_pipe_that_breaks_is_told(
    auvident: Callable[..., Called], fails: Callable[[BaseException], None]
) -> None:
    fails(BrokenPipeError(errno.EPIPE, "Broken pipe"))
    called = auvident("coefficients")
    assert called.code == 3 and "Broken pipe" in called.err


def test_an_export_to_a_device_leaves_the_device(
    demo: Path, auvident: Callable[..., Called]
) -> None:
    """Root replaced ``/dev/null`` by a file; a terminal stands for it here."""
    master, slave = os.openpty()
    called = auvident("export", demo, "--format", "toml", "--output", os.ttyname(slave))
    assert called.code == 0, called.err
    assert Path(os.ttyname(slave)).is_char_device()
    assert b"REMUS" in os.read(master, 1000)
    os.close(master), os.close(slave)


@pytest.mark.parametrize("name", ["/dev/stdout", "/dev/fd/1", "/proc/self/fd/1", "link"])
def test_an_output_that_is_standard_output_goes_there(name: str, demo: Path) -> None:
    """Into a pipe, which has no name, and behind what a shell has written into a file."""
    Path("link").symlink_to("/dev/stdout")
    words = [*COMMAND, "export", str(demo), "--format", "toml", "--output", name]
    done = subprocess.run(words, env=ENVIRONMENT, capture_output=True, text=True, check=True)
    assert done.stdout.startswith("# REMUS")
    told = Path("told.toml")
    told.write_text("# before\n")
    with told.open("a") as stream:
        subprocess.run(words, env=ENVIRONMENT, stdout=stream, stderr=subprocess.DEVNULL, check=True)
        print("# after", file=stream)
    lines = told.read_text().splitlines()
    assert lines[0] == "# before" and lines[1].startswith("# REMUS") and lines[-1] == "# after"


def test_a_table_goes_into_a_pipe_as_csv_whose_reader_may_leave(demo: Path) -> None:
    words = [*COMMAND, "simulate", str(demo), "--maneuver", "zigzag:10/10", "--samples", "2"]
    words += ["--output", "/dev/stdout"]
    done = subprocess.run(words, env=ENVIRONMENT, capture_output=True, text=True, check=True)
    assert done.stdout.startswith("time_s,rudder_rad,")
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    with subprocess.Popen(words, env=ENVIRONMENT, **pipes) as process:
        assert process.stdout is not None and process.stderr is not None
        process.stdout.close()
        told = process.stderr.read().decode()
    assert process.returncode == 0, told


@pytest.fixture
def far_hull(tmp_path: Path) -> Path:
    """A vehicle file whose offsets stand in the folder above."""
    text = VEHICLE
    lists = {k: re.search(rf"{k} = \[([^\]]*)\]\n", text) for k in KEYS}
    rows = [[c.strip() for c in found[1].split(",") if c.strip()] for found in lists.values()]
    for found in lists.values():
        text = text.replace(found[0], "")
    table = ["x_from_nose_m,radius_m", *(f"{x},{r}" for x, r in zip(*rows, strict=True))]
    (tmp_path / "hull.csv").write_text("\n".join(table))
    (tmp_path / "vehicle").mkdir()
    text = text.replace("[hull]", '[hull]\noffsets = "../hull.csv"')
    (tmp_path / "vehicle" / "v.toml").write_text(text)
    return tmp_path / "vehicle" / "v.toml"


@pytest.fixture
def short_log(tmp_path: Path) -> Path:
    """The beginning of a trial, called ``log``."""
    (tmp_path / "log").mkdir()
    for file in (SAMPLES / "harbour_trial").glob("*.csv"):
        head, *rows = file.read_text().splitlines()
        kept = [row for row in rows if float(row.partition(",")[0]) < 400.0]
        (tmp_path / "log" / file.name).write_text("\n".join([head, *kept, ""]))
    return tmp_path / "log"


KEYS = ("offsets_x_from_nose_m", "offsets_radius_m")


def test_files_outside_are_read_when_that_is_allowed(
    far_hull: Path, short_log: Path, tmp_path: Path, auvident: Callable[..., Called]
) -> None:
    run = tmp_path / "run"
    for words in (
        ("ase", "--vehicle", far_hull),
        ("ingest", short_log, "--vehicle", far_hull, "--run", run),
        ("simulate", far_hull, "--maneuver", "turning-circle:15", "--samples", "0"),
        ("export", far_hull, "--format", "pvs"),
    ):
        called = auvident(*words)
        assert called.code == 3, called.err
        assert "--allow-outside" in called.err
        called = auvident(*words, "--allow-outside")
        assert called.code == 0, called.err
    assert '"allow_outside": true' in (run / "run.json").read_text()
    assert auvident("ase", "--vehicle", far_hull).code == 3  # not remembered by the process


SPELLINGS = ("log", "./log", "log/", "{here}/log", "../{name}/log", "link", "sub/../log")


def test_it_does_not_matter_how_a_path_was_typed(
    short_log: Path,
    tmp_path: Path,
    auvident: Callable[..., Called],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Of the same log, the artifacts of ingest are the same to the byte."""
    shutil.copy(SAMPLES / "remus100.toml", tmp_path)
    (tmp_path / "link").symlink_to("log")
    (tmp_path / "sub").mkdir()
    found, vehicle = {}, tmp_path / "remus100.toml"
    texts = [s.format(here=tmp_path, name=tmp_path.name) for s in SPELLINGS]
    for folder, text in [*((tmp_path, text) for text in texts), (short_log, ".")]:
        monkeypatch.chdir(folder)
        called = auvident(
            "ingest", text, "--vehicle", vehicle, "--run", tmp_path / "run", "--quiet"
        )
        assert called.code == 0, called.err
        found[text] = {p.name: p.read_bytes() for p in (tmp_path / "run" / "ingest").iterdir()}
    first = found["log"]
    assert b'"log/dvl.csv' in first["quality.json"]
    assert [text for text, files in found.items() if files != first] == []
