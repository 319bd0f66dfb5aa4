"""Everything that the program prints, at 80 and at 120 columns.

``AUVIDENT_WRITE_TERMINAL=1 pytest tests/test_terminal.py`` writes `tests/data/terminal` anew, to be
read and committed: numbers are left out of the comparison, they differ between libraries.
"""

import json
import os
import re
import shutil
import subprocess
import sys
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import click
import pytest

from auvident.cli import cli
from auvident.report.console_style import broken, rich_table
from auvident.report.tables import Column, Number, Table, columns
from tests import terminal
from tests.command_line import ENVIRONMENT, ROOT, Called
from tests.report.test_console import text_of

KEPT = ROOT / "tests" / "data" / "terminal"
WRITE = "AUVIDENT_WRITE_TERMINAL"
STAGES = {stage.name for stage in terminal.STAGES}
METAVAR = re.compile(r"(?:LOG|RUN|FOLDER|V\.toml|ARGS\])\.\.\.")
WIDE = {"run-quiet"}  # one line for a machine


@pytest.fixture
def other(demo: Path) -> Path:
    """A second run beside the finished one."""
    shutil.copytree(demo, "runs/other")
    return demo


@pytest.mark.parametrize("width", [80, 120])
def test_everything_fits_the_terminal_and_nothing_is_cut(
    other: Path, auvident: Callable[..., Called], monkeypatch: pytest.MonkeyPatch, width: int
) -> None:
    monkeypatch.setenv("COLUMNS", str(width))
    for name, text in terminal.printed(other, width, auvident):
        assert text.strip(), name
        too_long = [line for line in text.splitlines() if len(line.rstrip()) > width]
        assert name in WIDE or not too_long, f"{name}: {too_long}"
        whole = METAVAR.sub("", text)
        assert "…" not in whole and "..." not in whole, name
        if width == terminal.NARROW:
            kept(name, text)


def kept(name: str, text: str) -> None:
    """The words are those in the file that was read; the numbers may differ."""
    file = KEPT / f"{name}.txt"
    text = "\n".join(line.rstrip() for line in text.splitlines()) + "\n"
    if os.environ.get(WRITE):
        file.write_text(text, encoding="utf-8")
    assert words(text) == words(file.read_text(encoding="utf-8")), f"read it, then {WRITE}=1"


def words(text: str) -> Counter[str]:
    """Words of a text, broken lines and numbers aside."""
    return Counter(re.findall(r"[A-Za-z]{4,}", text))


def test_no_text_is_kept_of_what_is_gone() -> None:
    helps = {f"help-{name}" for name in ("auvident", *terminal.NAMES)}
    assert {f.stem for f in KEPT.iterdir()} <= helps | {*terminal.CALLS, *terminal.SHOWN}


# --- JSON ---------------------------------------------------------------------------------

# What a command needs besides --json; those that are not named need nothing.
GIVEN = {
    "run": ("--run", "runs/demo"),
    "compare": ("runs/demo", "runs/other"),
    "simulate": terminal.CALLS["simulate-spiral"][1:],
    "combine": ("runs/demo",),
    "export": ("runs/demo",),
    "inspect": ("sample_logs/harbour_trial/gyro.csv",),
    "completion": ("bash",),
    "warm-up": (),
    "new-vehicle": (),
    "coefficients": (),
    "effects": (),
    "schema": (),
}


@pytest.mark.usefixtures("other")
@pytest.mark.parametrize(
    "name",
    [
        n for n in cli.list_commands(click.Context(cli)) if n not in STAGES | {"campaign"}
    ],  # which `tests/test_campaign.py` runs
)
def test_json_is_alone_on_standard_output(auvident: Callable[..., Called], name: str) -> None:
    """Of every command; `tests/test_cli.py` holds that of the stages against their artifacts."""
    called = auvident(name, *GIVEN.get(name, ("runs/demo",)), "--json")
    assert called.code == 0, called.err
    assert json.loads(called.out)
    assert called.out.endswith("\n")


# --- help ---------------------------------------------------------------------------------


@pytest.mark.parametrize("name", terminal.NAMES)
def test_the_help_of_an_option_says_more_than_its_default(name: str) -> None:
    command = cli.get_command(click.Context(cli), name)
    assert command is not None
    for option in (p for p in command.params if isinstance(p, click.Option)):
        assert re.sub(r"\[.*?\]", "", option.help or "").strip(), option.name


# --- completion ---------------------------------------------------------------------------


def completed_words(line: str, folder: Path) -> list[str]:
    """What bash is told to complete a line with."""
    typed = line.split(" ")
    asked = {"COMP_WORDS": line, "COMP_CWORD": str(len(typed) - 1)}
    done = subprocess.run(
        [sys.executable, "-m", "auvident"],
        env={**ENVIRONMENT, **asked, "_AUVIDENT_COMPLETE": "bash_complete"},
        cwd=folder,
        capture_output=True,
        text=True,
        check=True,
    )
    return [row.split(",", 1)[1] for row in done.stdout.splitlines() if row]


@pytest.mark.parametrize(
    ("line", "found"),
    [
        ("auvident sta", ["status"]),
        ("auvident segment runs/demo --hold-out harbour_trial-turn-4", ["harbour_trial-turn-4"]),
        ("auvident validate runs/demo --fail-above hea", ["heading="]),
        ("auvident identify runs/demo --plan tog", ["together", "tog"]),
        ("auvident simulate runs/demo --maneuver pull", ["pull-out"]),
        ("auvident segment runs/nothing --hold-out x", []),
    ],
)
def test_a_shell_completes_what_is_typed(completed: Path, line: str, found: list[str]) -> None:
    assert completed_words(line, completed) == found


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_the_script_is_one_of_that_shell(auvident: Callable[..., Called], shell: str) -> None:
    script = auvident("completion", shell).out
    assert f"_AUVIDENT_COMPLETE={shell}_complete" in script
    if shutil.which(shell):
        checked = subprocess.run([shell, "-n"], input=script, text=True, capture_output=True)
        assert checked.returncode == 0, checked.stderr


# --- tables -------------------------------------------------------------------------------


def test_a_number_keeps_to_its_unit() -> None:
    assert broken("more than 0.7 deg", 12) == "more than\n0.7 deg"
    assert broken("damping 24 kg m^2 s and", 12) == "damping\n24 kg m^2 s\nand"
    assert broken("value, ± std", 8) == "value,\n± std"


def test_columns_move_closer_before_they_go_into_a_second_block() -> None:
    heads = (Column("name"), *(Column(f"value {k}", numeric=True) for k in range(7)))
    rows = [[name, *(Number(k + 0.123, 4) for k in range(7))] for name in ("a", "b")]
    table = rich_table(Table(heads, rows, "A title that is longer than its table is wide" * 2))
    wide, narrow, less = (text_of([table], width) for width in (90, 74, 40))
    assert wide.splitlines()[1].startswith(" name   value 0")
    assert narrow.splitlines()[2].startswith("name  value 0")
    assert narrow.count("name") == 1 and less.count("name") == 2


def test_a_second_block_repeats_what_tells_the_rows_apart() -> None:
    words = ("role", "channel", "first " * 4, "second " * 4, "third " * 4)
    rows = [["validate", "u", *"abc"], ["validate", "v", *"abc"]]
    text = text_of([rich_table(Table(columns(words), rows))], 50)
    assert text.count("role") == text.count("channel") == 2
