"""The commands of README.md and of docs/ work, in their order.

Each page has a folder of its own with the sample logs and the finished run of the README's first
command, which was run where there were the sample logs alone. A block that begins with ```console
is run: lines that begin with ``$ `` are commands, what follows a command is what it prints, of
which every line must occur in its output ("..." stands for anything). Commands of ``make`` are left
to the checks that make the environment.
"""

import re
import shlex
import shutil
import tomllib
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

import click
import pandas as pd
import pytest

from auvident.cli import COMMANDS, cli
from auvident.schema.logs import ColumnMap
from auvident.schema.plan import Plan
from auvident.schema.vehicle import Vehicle
from auvident.storage.declared import parse
from tests import foreign_log
from tests.command_line import ROOT, call
from tests.finished_run import COMMAND, Finished, shell

README = (ROOT / "README.md").read_text()
PAGES = {p.name: p.read_text() for p in (ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md")))}
EVERYTHING = "\n".join(PAGES.values())
COMMANDS_OF_PROGRAM = {name for names in COMMANDS.values() for name in names}
SHOWN_EXIT_CODE = re.compile(r"^\$ echo \$\?$")
SKIPPED = ("make ", "git ", "cd ")
NAMED_FILE = re.compile(r"# ([\w-]+\.toml)\n")
OWN_LOG = ("own-log.md", "my_trial.csv")  # a page that begins with a log of its reader


@dataclass
class Example:
    """A command, what the README says it prints, and the exit code it is said to leave."""

    command: str
    printed: list[str] = field(default_factory=list)
    code: int = 0


def examples(text: str) -> list[Example]:
    """Commands of the console blocks in order."""
    found: list[Example] = []
    for kind, block in re.findall(r"^```(console|toml)\n(.*?)^```", text, re.MULTILINE | re.DOTALL):
        if kind == "toml":
            named = NAMED_FILE.match(block)
            found += [Example(f"cat > {named[1]} <<'END'\n{block}END\n")] if named else []
            continue
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
    (written,) = examples("```toml\n# a.toml\nb = 1\n```\n```toml\nc = 2\n```\n")
    assert written.command == "cat > a.toml <<'END'\n# a.toml\nb = 1\nEND\n"


@pytest.fixture(scope="module")
def folder_of(tmp_path_factory: pytest.TempPathFactory, completed: Path) -> Callable[[str], Path]:
    """A folder for each page, as its reader has it; without the environment."""

    @cache
    def made(page: str) -> Path:
        copy = tmp_path_factory.mktemp("page")
        shutil.copytree(ROOT / "sample_logs", copy / "sample_logs")
        shutil.copytree(completed / "runs", copy / "runs")
        if page == OWN_LOG[0]:
            foreign_log.write(copy / OWN_LOG[1])
        return copy

    return made


SAMPLE = "runs/demo/ingest/harbour_trial.parquet"
# half the noise of a sensor [m/s, rad/s], and of an angle half of what the servo moves in 50 ms
NOISE = {"u_mps": 0.0025, "v_mps": 0.0025, "r_radps": 0.004, "rudder_rad": 0.001}
EXAMPLES = [(page, e) for page, text in PAGES.items() for e in examples(text)]


def test_the_first_command_of_the_readme_is_the_run_that_all_pages_have() -> None:
    page, example = EXAMPLES[0]
    assert page == "README.md" and example.command.split() == COMMAND.split()


@pytest.mark.parametrize("page", dict.fromkeys(page for page, _ in EXAMPLES))
def test_the_commands_of_a_page(
    folder_of: Callable[[str], Path], finished: Finished, page: str
) -> None:
    """One after the other: many need what those before them have left."""
    for example in (e for p, e in EXAMPLES if p == page):
        is_first = (page, example) == EXAMPLES[0]
        done = finished.called if is_first else shell(example.command, folder_of(page))
        assert done.code == example.code, f"{example.command}: {done.err}"
        output = done.out + done.err
        for line in example.printed:
            pieces = [re.escape(piece.strip()) for piece in line.split("...")]
            told = re.search(".*".join(pieces), output)
            assert told, f"{example.command}: {line!r} not in:\n{output}"


def test_the_log_of_the_reader_is_read_as_the_sample_it_is(
    completed: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Names, knots, sign and separator make no difference: what is identified would be the same."""
    monkeypatch.chdir(tmp_path)
    page, log = OWN_LOG
    foreign_log.write(Path(log))
    (shown,) = re.findall(r"^```text\n(.*?)^```", PAGES[page], re.MULTILINE | re.DOTALL)
    assert set(shown.splitlines()) <= set(Path(log).read_text().splitlines())
    (own_map,) = re.findall(r"^```toml\n(.*?)^```", PAGES[page], re.MULTILINE | re.DOTALL)
    Path("map.toml").write_text(own_map)
    vehicle = ROOT / "sample_logs/remus100.toml"
    done = call(
        *("ingest", log, "--vehicle", vehicle, "--map", "map.toml"),
        *("--run", "own", "--fix", "rudder_sign"),
    )
    assert done.code == 0, done.err
    own, sample = (
        pd.read_parquet(place).set_index("time_s")
        for place in ("own/ingest/my_trial.parquet", completed / SAMPLE)
    )
    both = own.index.round(6).intersection(sample.index.round(6))
    assert len(both) > 0.99 * len(sample)
    own, sample = (t.set_index(t.index.round(6)).loc[both] for t in (own, sample))
    for column, noise in NOISE.items():
        difference = own[column] - sample[column]
        assert difference.abs().median() < noise, column
        assert abs(difference.median()) < 0.1 * noise, column


@pytest.mark.parametrize(
    "page", [p for p, text in PAGES.items() if "```python" in text and p != "campaigns.md"]
)  # tests/test_campaign.py runs those
def test_the_python_of_a_page(folder_of, page: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(folder_of(page))
    for block in re.findall(r"^```python\n(.*?)^```", PAGES[page], re.MULTILINE | re.DOTALL):
        exec(compile(block, page, "exec"), {})


@pytest.mark.parametrize(
    "command", sorted(set(re.findall(r"`auvident ([a-z][a-z-]+)", EVERYTHING)))
)
def test_commands_that_the_text_names_exist(command: str) -> None:
    assert command in COMMANDS_OF_PROGRAM


@pytest.mark.parametrize("command", sorted(COMMANDS_OF_PROGRAM))
def test_every_command_is_told(command: str) -> None:
    assert re.search(rf"auvident {command}\b|`{command}`", EVERYTHING)


@pytest.mark.parametrize(
    "command", ["auvident effects", "auvident coefficients --plane horizontal"]
)
def test_a_table_of_the_program_is_whole(command: str) -> None:
    """Not only is every line of it what the program prints: none is missing."""
    shown = next(e for _, e in EXAMPLES if e.command == command)
    assert shown.printed == call(*command.split()[1:]).out.splitlines()


@pytest.mark.parametrize(
    ("page", "declared"),
    [
        ("README.md", Vehicle),
        ("plans.md", Plan),
        ("logs.md", ColumnMap),
        ("own-log.md", ColumnMap),
    ],
)
def test_a_file_that_a_page_shows_can_be_read(page: str, declared: type) -> None:
    """The least vehicle file, a map, a plan (without the stages that it continues)."""
    texts = re.findall(r"^```toml\n(.*?)^```", PAGES[page], re.MULTILINE | re.DOTALL)
    assert texts
    for text in texts:
        parse(declared, tomllib.loads(text), Path(page), "")


def shown_only() -> list[str]:
    """Commands of the program that pages show without running them, or as part of a table."""
    blocks = re.findall(r"^```sh\n(.*?)^```", EVERYTHING, re.MULTILINE | re.DOTALL)
    lines = "\n".join(blocks).replace("\\\n", " ").splitlines()
    cells = re.findall(r"^\| \d \| `(auvident [^`]+)`", EVERYTHING, re.MULTILINE)
    return [line.partition(">")[0] for line in (*lines, *cells) if line.startswith("auvident ")]


@pytest.mark.parametrize("command", dict.fromkeys(shown_only()))
def test_a_command_that_is_only_shown_can_be_parsed(command: str) -> None:
    """Its name, its options and their values; whether its files are there is another matter."""
    _, name, *arguments = shlex.split(command)
    found = cli.get_command(click.Context(cli), name)
    assert found is not None
    found.make_context(name, arguments)


def test_commands_are_no_shell_riddles() -> None:
    for _, example in EXAMPLES:
        assert shlex.split(example.command)


def test_every_exit_code_is_explained() -> None:
    from auvident.errors import AuvidentError

    for code in {kind.exit_code for kind in AuvidentError.__subclasses__()}:
        for page in ("README.md", "run-directory.md"):
            assert re.search(rf"^\| {code} \| \w", PAGES[page], re.MULTILINE), code
        assert re.search(rf"\b{code} \w", cli.help or ""), code
