"""--summary and --junit: what a CI system is told, however a command ends."""

import dataclasses
import json
import re
import shutil
from collections.abc import Callable
from pathlib import Path
from xml.etree import ElementTree

import pytest

from auvident.errors import NumericsError
from auvident.pipeline.gates import baseline_gates
from auvident.pipeline.table import BY_NAME
from auvident.report.junit import junit_bytes
from auvident.report.pull_request import escaped, markdown
from auvident.schema.artifacts import Finding
from auvident.schema.outcome import (
    SEVERITIES,
    CommandOutcome,
    GateResult,
    HeldOutError,
    PlaneOutcome,
    ResultCase,
    severity,
)
from tests.command_line import ROOT, Called

MOST_LINES = 40  # of a comment that people read
# Elements, their attributes and their children in junit-10.xsd of the xUnit plugin of Jenkins,
# as far as they may stand here; the attributes it asks for are those with a star.
SCHEMA = {
    "testsuites": ("name tests failures errors time", "testsuite"),
    "testsuite": ("name* tests* failures* errors* skipped time timestamp", "testcase"),
    "testcase": ("name* classname time", "skipped error failure system-out"),
    "skipped": ("message type", ""),
    "error": ("message type", ""),
    "failure": ("message type", ""),
    "system-out": ("", ""),
}
Auvident = Callable[..., Called]


def read(file: Path | bytes) -> ElementTree.Element:
    """A file that fits the schema and whose counts are right."""
    content = file.read_bytes() if isinstance(file, Path) else file
    root = ElementTree.fromstring(content)
    assert root.tag == "testsuites"
    for element in root.iter():
        attributes, children = (text.split() for text in SCHEMA[element.tag])
        assert set(element.attrib) <= {name.rstrip("*") for name in attributes}, element.attrib
        assert {name[:-1] for name in attributes if name.endswith("*")} <= set(element.attrib)
        assert {child.tag for child in element} <= set(children), element.tag
    for suite in (root, *root):
        cases = list(suite.iter("testcase"))
        assert int(suite.attrib["tests"]) == len(cases)
        assert int(suite.attrib["failures"]) == sum(c.find("failure") is not None for c in cases)
        assert int(suite.attrib["errors"]) == sum(c.find("error") is not None for c in cases)
    names = [(c.attrib["classname"], c.attrib["name"]) for c in root.iter("testcase")]
    assert len(set(names)) == len(names)
    return root


def case(root: ElementTree.Element, group: str, name: str) -> ElementTree.Element:
    (found,) = (
        c
        for c in root.iter("testcase")
        if (c.attrib["classname"], c.attrib["name"]) == (f"auvident.{group}", name)
    )
    return found


def test_a_run_tells_stages_checks_findings_and_gates(demo: Path, auvident: Auvident) -> None:
    files = ("--summary", "out/told.md", "--junit", "out/told.xml")
    limits = ("--fail-above", "u=9", "--fail-above", "r=0.001")
    assert auvident("run", "--run", demo, *limits, *files).code == 1
    root = read(Path("out/told.xml"))
    assert [suite.attrib["name"] for suite in root] == [
        f"auvident.{group}" for group in ("stages", "checks", "findings", "gates")
    ]
    stages = [c.attrib["name"] for c in root[0]]
    assert stages == list(BY_NAME)
    assert case(root, "stages", "combine").find("skipped") is not None
    failed = [c for c in root.iter("testcase") if c.find("failure") is not None]
    assert [c.attrib["name"] for c in failed] == ["RMSE of r at most 0.001 rad/s"]
    quality = json.loads((demo / "ingest/quality.json").read_text())
    assert len(root[1]) == len(quality["trials"][0]["checks_made"])
    text = Path("out/told.md").read_text()
    assert len(text.splitlines()) <= MOST_LINES
    assert text.startswith("## `auvident run runs/demo`: gate not met")
    metrics = json.loads((demo / "validate/metrics.json").read_text())["summary"]["validate"]
    (row,) = re.findall(r"^\| r \|.*$", text, re.M)
    assert f"{float(format(metrics['r']['rmse'], '.2e')):g}" in row
    assert "**0.001, not met**" in row
    assert "The model lacks nothing" in text


def test_a_command_tells_the_stages_that_lead_to_it(demo: Path, auvident: Auvident) -> None:
    for command in ("validate", "refine"):
        assert auvident(command, demo, "--junit", "told.xml", "--quiet").code == 0
        stages = [c.attrib["name"] for c in read(Path("told.xml"))[0]]
        assert stages[-1] == command
        assert "report" not in stages


def test_a_refinement_tells_its_verdict_and_errors(demo: Path, auvident: Auvident) -> None:
    """It does not rest on validate, and told neither."""
    run, refine = (
        (*words, "--quiet", "--summary", "told.md")
        for words in (("run", "--run", demo), ("refine", demo))
    )
    assert auvident(*run).code == 0
    whole = re.findall(
        r"^\| .*$|^Held out: .*$|^The model lacks .*$", Path("told.md").read_text(), re.M
    )
    assert auvident(*refine, "--junit", "told.xml").code == 0
    own = Path("told.md").read_text()
    assert len(whole) >= 7 and all(line in own for line in whole)
    shutil.rmtree(demo / "validate")
    assert auvident(*refine).code == 0
    (row,) = re.findall(r"^\| r \|.*$", Path("told.md").read_text(), re.M)
    (before,) = (line for line in whole if line.startswith("| r |"))
    assert row.split("|")[4] == before.split("|")[4]  # that of geometry is not known any more
    assert row.split("|")[3].strip() == "" and "Held out: " in Path("told.md").read_text()


def test_a_summary_is_replaced_but_a_step_summary_grows(
    demo: Path, auvident: Auvident, monkeypatch: pytest.MonkeyPatch
) -> None:
    runs = ("run", "--run", demo, "--quiet", "--summary", "told.md")
    assert auvident(*runs).code == 0
    once = Path("told.md").read_text()
    assert ": passed" in once and "report `runs/demo/report/report.html`" in once
    assert auvident(*runs).code == 0
    assert Path("told.md").read_text() == once
    monkeypatch.setenv("GITHUB_STEP_SUMMARY", str(Path("told.md").resolve()))
    assert auvident(*runs).code == 0
    assert Path("told.md").read_text() == f"{once}\n{once}"


def test_a_failed_stage_is_an_error(
    demo: Path, auvident: Auvident, monkeypatch: pytest.MonkeyPatch
) -> None:
    def diverge(given: object) -> None:
        raise NumericsError("the filter diverged", "zigzag-1, 12.3 s", "Use another plan.")

    stage = dataclasses.replace(BY_NAME["validate"], function=diverge)  # type: ignore[arg-type]
    monkeypatch.setitem(BY_NAME, "validate", stage)
    called = auvident("validate", demo, "--junit", "told.xml", "--summary", "told.md")
    assert called.code == 5
    root = read(Path("told.xml"))
    error = case(root, "stages", "validate").find("error")
    assert error is not None and error.text is not None
    assert error.attrib == {"message": "the filter diverged", "type": "NumericsError"}
    assert "zigzag-1, 12.3 s" in error.text
    assert root.attrib["errors"] == "1"
    text = Path("told.md").read_text()
    assert "numerical failure" in text and "the filter diverged" in text
    assert "| r |" not in text  # what an earlier run predicted is not the result of this one


def test_unusable_input_is_an_error_of_ingest(tmp_path: Path, auvident: Auvident) -> None:
    files = ("--junit", tmp_path / "told.xml", "--summary", tmp_path / "told.md")
    called = auvident(
        "run", tmp_path / "no", "--vehicle", "no.toml", "--run", tmp_path / "r", *files
    )
    assert called.code == 3
    assert not (tmp_path / "r").exists()
    assert case(read(tmp_path / "told.xml"), "stages", "ingest").find("error") is not None
    assert "unusable input" in (tmp_path / "told.md").read_text()


def test_what_is_no_fault_of_a_stage_is_one_of_the_command(demo: Path, auvident: Auvident) -> None:
    called = auvident("run", "--run", demo, "--fail-above", "q=1", "--junit", "told.xml")
    assert called.code == 2
    root = read(Path("told.xml"))
    assert next(root.iter("testcase")).attrib["classname"] == "auvident.command"
    assert root.attrib["errors"] == "1"


def test_files_that_cannot_be(demo: Path, auvident: Auvident) -> None:
    Path("file").write_text("")
    runs = ("run", "--run", demo, "--quiet")
    assert auvident(*runs, "--summary", "both", "--junit", "both").code == 2
    assert auvident(*runs, "--summary", "runs").code == 2
    assert auvident(*runs, "--summary", "file/told.md").code == 3
    called = auvident(*runs, "--fail-above", "r=1e-9", "--summary", "file/told.md")
    assert called.code == 1  # the gate is what the caller has to hear of
    assert "cannot be written" in called.err and "r: RMSE" in called.err


HOSTILE = "<script>]]>&\"'|`x`\n# @team [a](http://x.org) \x1b[31m\x00\udcff\ufffe" + "y" * 9000


def hostile() -> CommandOutcome:
    error = HeldOutError(HOSTILE, HOSTILE, 1.0, 2.0, None, None, 0.5)
    return CommandOutcome(
        HOSTILE,
        HOSTILE,
        HOSTILE,
        HOSTILE,
        HOSTILE,
        3,
        "2026-01-01T00:00:00+00:00",
        HOSTILE,
        [PlaneOutcome("horizontal", HOSTILE, [HOSTILE] * 99, [error], [HOSTILE] * 99)],
        [GateResult(HOSTILE, 1.0, 2.0, HOSTILE, HOSTILE, HOSTILE)] * 99,
        [Finding(code="not-seen", message=HOSTILE.replace("\udcff", ""), where=HOSTILE[:50])] * 99,
        [ResultCase("checks", HOSTILE, "failed", HOSTILE, HOSTILE, HOSTILE)],
        [
            {
                "runs": [
                    {"run": HOSTILE, "vehicle": name, "length_m": 1.0}
                    | {"plane": "horizontal", "held_out": ["a"]}
                    for name in (HOSTILE, "B")
                ],
                "held_out": [{"channel": HOSTILE, "unit": "m", "rmse": [1.0, None]}],
            }
        ],
    )


def test_names_are_neither_xml_nor_markdown() -> None:
    told = case(
        read(junit_bytes(hostile())),
        "checks",
        ElementTree.fromstring(junit_bytes(hostile()))[0][0].attrib["name"],
    )
    assert "<script>" in told.attrib["name"] and "\\u001b" in told.attrib["name"]
    text = markdown(hostile())
    text.encode()
    outside = re.sub(r"`[^`\n]*`", "", text)
    assert len(text.splitlines()) <= 60  # every list at its longest
    assert not re.search(r"(?<!\\)<(?!/?sub>)|@(?!\u2060)|://|(?<!\\)\[", outside)
    assert not set(text) & set("\x00\x1b")
    assert escaped("a_b *c* #1 @x") == r"a\_b \*c\* \#1 @" + "\u2060x"


def test_severities_are_of_codes_that_the_program_has() -> None:
    sources = "".join(
        p.read_text() for p in (ROOT / "auvident").rglob("*.py") if "outcome" not in p.name
    )
    assert not [code for code in SEVERITIES if f'"{code}"' not in sources]
    assert severity(Finding(code="anything-else", message="")) == "warning"


def table(**last: object) -> dict:
    """Two runs alike, the second of which is the baseline."""
    run = {"run": "new", "vehicle": "A", "length_m": 2.0, "plane": "horizontal"}
    run |= {"held_out": ["z-1"], "ran_away": []}
    rows = [("u", 0.1, 0.1), ("r", 0.01, 0.01), ("track", None, 3.0)]
    return {
        "runs": [run, {**run, "run": "old", **last}],
        "held_out": [{"channel": c, "unit": "m/s", "rmse": [a, b]} for c, a, b in rows],
    }


def unmet(compared: dict, share: float = 0.1) -> list[str]:
    return [gate.unmet for gate in baseline_gates(compared, share) if gate.unmet]


def test_the_gates_of_both_planes_of_a_run_are_told_apart() -> None:
    beside = table()
    gates = baseline_gates({**table(), "planes": {"vertical": beside}}, 0.1)
    assert [(g.of, g.channel) for g in gates] == [
        ("new", "u"),
        ("new", "r"),
        ("new, vertical plane", "u"),
        ("new, vertical plane", "r"),
    ]


def test_a_change_is_that_of_the_first_run_against_the_last() -> None:
    """It stood under "first to last", which is the other way round; a rise of 0.2 % was -0 %."""
    compared = table()
    rows = zip(compared["held_out"], ((0.11, 0.1), (0.998, 1.0), (1.0, 2.0)), strict=True)
    held_out = [{**row, "rmse": list(errors)} for row, errors in rows]
    text = markdown(CommandOutcome("compare", 0, compared=({**compared, "held_out": held_out},)))
    assert "| first against last |" in text
    changes = [line.split("|")[-2].strip() for line in text.splitlines() if " m/s |" in line]
    assert changes == ["+10 %", "0 %", "-50 %"]


def test_what_cannot_be_compared_does_not_pass() -> None:
    assert unmet(table()) == []
    assert unmet(table(held_out=["z-2"])) == []  # compares roughly, which is said
    assert len(baseline_gates(table(), 0.1)) == 2  # the track is told by some stages only
    for key, value, words in (
        ("vehicle", "B", "its vehicle is 'A'"),
        ("plane", "vertical", "it is of the horizontal plane"),
    ):
        (told,) = unmet(table(**{key: value}))
        assert words in told
    away = table()
    away["runs"][0] = {**away["runs"][0], "ran_away": ["z-1"]}
    assert unmet(away) == ["the prediction diverges in z-1"]
    lost = table()
    lost["held_out"][0]["rmse"] = [None, 0.1]
    lost["held_out"][1]["rmse"] = [float("nan"), 0.01]
    assert len(unmet(lost)) == 2
    assert "old has no held-out error" in unmet(table(held_out=[]))[0]


def test_a_plane_of_the_baseline_must_be_there() -> None:
    only_old = {**table(), "planes": {"vertical": {**table(), "runs": [table()["runs"][1]]}}}
    assert unmet(only_old) == ["it has no vertical plane, which the baseline has"]
    only_new = {**table(), "planes": {"vertical": {**table(), "runs": [table()["runs"][0]]}}}
    assert unmet(only_new) == []


def test_a_baseline_of_an_earlier_version_is_compared_as_it_ended(
    demo: Path, auvident: Auvident
) -> None:
    shutil.copytree(demo, "runs/old")
    manifest = Path("runs/old/run.json")
    manifest.write_text(manifest.read_text().replace('"0.1.0"', '"0.0.9"'))
    gate = ("compare", demo, "runs/old", "--fail-if-worse", "0", "--json")
    called = auvident(*gate, "--junit", "told.xml", "--summary", "told.md")
    assert called.code == 0, called.err
    runs = json.loads(called.out)["runs"]
    assert [Path(run["model"]).parent.name for run in runs] == ["refine", "refine"]
    assert read(Path("told.xml"))[0].attrib["name"] == "auvident.gates"
    assert "| r |" in Path("told.md").read_text()
    (demo / "identify/model.json").write_text("{}")  # what the errors were of is gone
    assert auvident("validate", "runs/old", "--quiet").code == 4


def test_errors_of_a_model_that_was_replaced_are_not_compared(
    demo: Path, auvident: Auvident
) -> None:
    shutil.copytree(demo, "runs/new")
    assert auvident("identify", "runs/new", "--plan", "together", "--quiet").code == 0
    called = auvident("compare", "runs/new", demo, "--fail-if-worse", "10%", "--quiet")
    assert called.code == 1
    assert "runs/new has no held-out error; run `auvident validate runs/new`" in called.err
