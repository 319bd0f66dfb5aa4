"""Pages of the reference that derive from the program: its commands, its findings.

A finding is declared where it is made, as ``Finding(code=..., message=..., remedy=...)``; what is
filled in at run time stands as "…". Codes that are themselves filled in come from their tables.
"""

import ast
import inspect
import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import click

from auvident.cli import COMMANDS, cli
from auvident.errors import AuvidentError
from auvident.schema.artifacts import ESTIMATE_CONTRADICTED, RAN_AWAY
from auvident.stages.diagnose.verdict.taken_up import TAKEN_UP
from auvident.stages.ingest.checks.table import CHECKS
from auvident.stages.ingest.remarks import FAULTS
from auvident.stages.pool.stage import FITS_NO_OTHER
from tests.bench.written import table

PACKAGE = Path(__file__).resolve().parents[2] / "auvident"
WRITTEN = "<!-- written by `make docs` from the program; not to be edited -->"
COMMANDS_HEAD = f"""# Commands

{WRITTEN}

What `auvident COMMAND --help` prints. [The run directory](run-directory.md) has the exit codes, and
[recipes](recipes.md) the commands in use.
"""
FINDINGS_HEAD = f"""# Findings

{WRITTEN}

A finding is something to know before a number is used. It stands on the terminal, in the report and
in the artifact of its stage, with its code, where it holds, evidence, and what to do about it. "…"
stands for what is filled in. None of them ends a run; what does is an error, below.
"""
STAGE_OF = {  # by folder or module, where the name of the stage is not the one below `stages`
    "physics/ase": "ase",
    "pipeline/ingesting": "ingest",
    "pipeline/planes": "run",
    "stages/desk": "simulate",
    "storage": "ingest",
}
FILLED_IN = "…"
Filled = dict[str, list[tuple[str, str, str]]]  # code, words, remedy by stage and expression
# Words of findings that are put together elsewhere: what it says, what to do.
ELSEWHERE = {
    "constant_input": ("an input was not logged: the map states it for the whole trial", ""),
    "log_damaged": ("what the reader of a recording could not read", ""),
    "log_refused": ("one of several logs cannot be used, and why", "As the message says."),
    "not-identified": ("how many coefficients are from geometry, how many as given", ""),
    "prior-contradicted": (
        "the data contradict the prior of a coefficient, or what the vehicle file says",
        "As the message says, by the group of the coefficient.",
    ),
    "standard-not-flown": ("a standard maneuver could not be flown with the model, and why", ""),
}
COMMANDED = ("rudder", "elevator", "rpm")
BRACKETED = re.compile(r"\s*\[([^\[\]]+)\]")  # Markdown would take them for links
OTHERS = ("dvl", "attitude", "depth", "position")


@dataclass(frozen=True)
class Told:
    """A finding as its declaration has it."""

    stage: str
    code: str
    message: str
    remedy: str


# --- commands -----------------------------------------------------------------------------


def commands_page() -> str:
    """Every command with its usage, help, options and examples."""
    parent = click.Context(cli, info_name="auvident")
    names = [name for group in COMMANDS.values() for name in group]
    return COMMANDS_HEAD + "".join(_command(name, parent) for name in names)


def _command(name: str, parent: click.Context) -> str:
    found = cli.get_command(parent, name)
    assert found is not None
    context = click.Context(found, info_name=name, parent=parent)
    usage = " ".join(["auvident", name, *found.collect_usage_pieces(context)])
    records = [p.get_help_record(context) for p in found.get_params(context)]
    options = [
        {"option": f"`{names}`", "meaning": BRACKETED.sub(r" (\1)", said).strip()}
        for names, said in filter(None, records)
    ]
    help_text = inspect.cleandoc(found.help or "").replace("\b\n", "")
    examples = inspect.cleandoc((found.epilog or "").partition("\n")[2]).splitlines()[1:]
    shown = "\n".join(line.strip() for line in examples)
    return (
        f"\n## {name}\n\n```text\n{usage}\n```\n\n{_escaped(help_text)}\n\n"
        f"{table(options)}\n\n```sh\n{shown}\n```\n"
    )


def _escaped(text: str) -> str:
    """Text of the terminal that Markdown would take for its own."""
    return text.replace("[", "\\[").replace("<", "&lt;").replace("*", "\\*")


# --- findings -----------------------------------------------------------------------------


def findings_page() -> str:
    """Every finding with its stage, words and remedy, and the exit codes of errors."""
    rows = [
        {
            "code": f"`{told.code}`",
            "stage": told.stage,
            "what it says": told.message,
            "what to do": told.remedy,
        }
        for told in sorted(set(findings()), key=lambda t: (t.code, t.stage, t.message))
    ]
    return f"{FINDINGS_HEAD}\n{table(rows)}\n\n{_errors()}"


def _errors() -> str:
    rows = [
        {"exit code": kind.exit_code, "kind": f"`{kind.__name__}`", "what ended the command": words}
        for kind, words in sorted(_kinds(), key=lambda row: row[0].exit_code)
    ]
    head = "## Errors\n\nAn error is one message: what is wrong, where, what to do.\n\n"
    return head + table(rows) + "\n"


def _kinds() -> Iterator[tuple[type[AuvidentError], str]]:
    for kind in AuvidentError.__subclasses__():
        yield kind, (inspect.getdoc(kind) or "").splitlines()[0].replace("``", "`")


@cache
def findings() -> tuple[Told, ...]:
    """What the source declares, and the rows of tables that make codes."""
    return tuple(_declared(_from_tables()))


def _declared(filled: Filled) -> Iterator[Told]:
    for file in sorted(PACKAGE.rglob("*.py")):
        for call in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if not isinstance(call, ast.Call) or _name(call.func) != "Finding":
                continue
            given = {k.arg: k.value for k in call.keywords}
            yield from _told(_stage(file), given, filled)


def _told(stage: str, given: dict[str | None, ast.expr], filled: Filled) -> Iterator[Told]:
    message, remedy = (_text(given.get(key)) for key in ("message", "remedy"))
    remedy = "As the message says." if remedy == FILLED_IN else remedy
    code = given["code"]
    if isinstance(code, ast.Constant):
        said, advice = ELSEWHERE.get(str(code.value), (message, remedy))
        yield Told(stage, str(code.value), said, advice)
        return
    for own, said, advice in filled[f"{stage}: {ast.unparse(code)}"]:  # else a row is missing
        yield Told(stage, own, said or message, advice or remedy)


def _from_tables() -> Filled:
    """Codes by stage and expression, each with words and remedy where the source has none."""
    clocks = [f"gyro_lags_{s}" for s in COMMANDED] + [f"{s}_lags_gyro" for s in OTHERS]
    as_said = "As the message says; `--fix NAME` where it names one."
    return {
        "validate: RAN_AWAY": [(RAN_AWAY, "", "")],
        "refine: RAN_AWAY": [(RAN_AWAY, "", "")],
        "pool: FITS_NO_OTHER": [
            (
                FITS_NO_OTHER,
                "a trial that contradicts all others of its vehicle is left out: another vehicle, "
                "or a log that is wrong?",
                "As the message says.",
            )
        ],
        "identify: ESTIMATE_CONTRADICTED": [(ESTIMATE_CONTRADICTED, "", "")],
        "identify: 'held-out-in-part' if enough else 'held-out-within'": [
            ("held-out-in-part", "", ""),
            ("held-out-within", "", ""),
        ],
        "ingest: check.finding": [
            (c.finding, f"{c.what}: contradicted by {c.against}", as_said) for c in CHECKS
        ],
        "ingest: code": [(code, f"… samples of … {w}", todo) for code, w, todo in FAULTS.values()],
        "ingest: f'gyro_lags_{sensor}' if command else f'{sensor}_lags_gyro'": [
            (code, f"{code.replace('_', ' ')} by … s", as_said) for code in clocks
        ],
        "ingest: f'sensor_{code}'": [
            ("sensor_starts_late", "", ""),
            ("sensor_stops_early", "", ""),
        ],
        "segment: f'{fin}_sign'": [("rudder_sign", "", ""), ("elevator_sign", "", "")],
        "ase: f'no_{name}'": [("no_rudder", "", ""), ("no_elevator", "", "")],
        "diagnose: code": [(row.code, row.text.format(motion="in turns"), "") for row in TAKEN_UP],
    }


def _stage(file: Path) -> str:
    place = file.relative_to(PACKAGE).with_suffix("").as_posix()
    own = next((stage for start, stage in STAGE_OF.items() if place.startswith(start)), None)
    return own or place.split("/")[1]


def _name(function: ast.expr) -> str:
    return getattr(function, "id", getattr(function, "attr", ""))


def _text(node: ast.expr | None) -> str:
    """A string of the source, with "…" for what is filled in."""
    if node is None:
        return ""
    if isinstance(node, ast.Constant):
        return str(node.value)
    if isinstance(node, ast.JoinedStr):
        return "".join(_text(part) for part in node.values)
    if isinstance(node, ast.BinOp):
        return _text(node.left) + _text(node.right)
    if isinstance(node, ast.IfExp):
        return _text(node.body)
    if isinstance(node, ast.BoolOp):
        return _text(node.values[-1])
    return FILLED_IN
