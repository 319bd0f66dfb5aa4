"""The commands of README.md work, in its order, in a folder that has only the sample logs.

A block that begins with ```console is run: lines that begin with ``$ `` are commands, what
follows a command is what it prints, of which every line must occur in its output ("..." stands
for anything). Commands of ``make`` are left to the checks that make the environment.
"""

import re
import shlex
import shutil
import subprocess
from dataclasses import dataclass, field
from pathlib import Path

import pytest

from tests.command_line import ENVIRONMENT, ROOT

README = (ROOT / "README.md").read_text()
SHOWN_EXIT_CODE = re.compile(r"^\$ echo \$\?$")
SKIPPED = ("make ", "git ", "cd ")


@dataclass
class Example:
    """A command, what the README says it prints, and the exit code it is said to leave."""

    command: str
    printed: list[str] = field(default_factory=list)
    code: int = 0


def examples(text: str) -> list[Example]:
    """Commands of the console blocks in order."""
    found: list[Example] = []
    for block in re.findall(r"^```console\n(.*?)^```", text, re.MULTILINE | re.DOTALL):
        lines = iter(block.replace("\\\n", " ").splitlines())
        for line in lines:
            if SHOWN_EXIT_CODE.match(line):
                found[-1].code = int(next(lines))
            elif line.startswith("$ "):
                found.append(Example(line[2:]))
            elif line.strip():
                found[-1].printed.append(line)
    return [e for e in found if not e.command.startswith(SKIPPED)]


def test_the_parser_of_examples() -> None:
    block = "```console\n$ a b \\\n  c\nout ... put\n$ echo $?\n3\n$ make demo\n```\n"
    assert examples(f"text\n{block}more\n") == [Example("a b    c", ["out ... put"], 3)]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy of what a user has, without the environment."""
    copy = tmp_path_factory.mktemp("readme")
    shutil.copytree(ROOT / "sample_logs", copy / "sample_logs")
    return copy


@pytest.mark.parametrize("example", examples(README), ids=lambda e: e.command[:60])
def test_a_command_of_the_readme(folder: Path, example: Example) -> None:
    done = subprocess.run(
        example.command, shell=True, cwd=folder, env=ENVIRONMENT, capture_output=True, text=True
    )
    assert done.returncode == example.code, done.stderr
    output = done.stdout + done.stderr
    for line in example.printed:
        pieces = [re.escape(piece.strip()) for piece in line.split("...")]
        assert re.search(".*".join(pieces), output), f"{line!r} not in:\n{output}"


@pytest.mark.parametrize("command", sorted(set(re.findall(r"`auvident ([a-z-]+)", README))))
def test_commands_that_the_text_names_exist(command: str) -> None:
    from auvident.cli import COMMANDS

    assert command in {name for names in COMMANDS.values() for name in names}


@pytest.mark.parametrize(
    "command", ["auvident effects", "auvident coefficients --plane horizontal"]
)
def test_a_table_of_the_program_is_whole(command: str) -> None:
    """Not only is every line of it what the program prints: none is missing."""
    from tests.command_line import call

    shown = next(e for e in examples(README) if e.command == command)
    assert shown.printed == call(*command.split()[1:]).out.splitlines()


def test_commands_are_no_shell_riddles() -> None:
    for example in examples(README):
        assert shlex.split(example.command)


def test_every_exit_code_is_explained() -> None:
    from auvident.cli import cli
    from auvident.errors import AuvidentError

    for code in {kind.exit_code for kind in AuvidentError.__subclasses__()}:
        assert re.search(rf"^\| {code} \| \w", README, re.MULTILINE), code
        assert re.search(rf"\b{code} \w", cli.help or ""), code
