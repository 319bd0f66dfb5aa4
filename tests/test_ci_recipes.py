"""The files in docs/ci do what they promise: their commands run, on the finished run."""

import os
import re
import shlex
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.command_line import ENVIRONMENT, ROOT, Called

yaml = pytest.importorskip("yaml")

RECIPES = ROOT / "docs" / "ci"
SAMPLE = {"LOGS": "sample_logs/harbour_trial", "VEHICLE": "sample_logs/remus100.toml"}
FIRST = ("Install",)  # needs a network


@pytest.fixture
def repository(demo: Path) -> Path:
    """The finished run, as a job finds it that has the caches of an earlier one."""
    shutil.copytree(demo, "runs/baseline")
    demo.rename("runs/now")
    return Path()


def bash(script: str, **environment: str) -> subprocess.CompletedProcess:
    """A step as GitHub runs it."""
    return subprocess.run(
        ["bash", "--noprofile", "--norc", "-eo", "pipefail", "-c", script],
        env={**ENVIRONMENT, **environment},
        capture_output=True,
        text=True,
    )


def test_the_steps_of_the_workflow_run(repository: Path) -> None:
    (job,) = yaml.safe_load((RECIPES / "github-workflow.yml").read_text())["jobs"].values()
    steps = [s for s in job["steps"] if "run" in s and s["name"] not in FIRST]
    assert [s["name"] for s in steps] == [
        "Identify",
        "Compare with the main branch",
        "Keep as the baseline",
    ]
    told = Path("told.md").resolve()
    for step in steps:
        done = bash(step["run"], **job["env"] | SAMPLE, GITHUB_STEP_SUMMARY=str(told))
        assert done.returncode == 0, done.stderr
    headings = re.findall(r"^## (.*)$", told.read_text(), re.MULTILINE)
    assert headings == [
        "`auvident run runs/now`: passed",
        "`auvident compare runs/now runs/baseline`: passed",
    ]
    kept = next(s for s in job["steps"] if "upload-artifact" in s.get("uses", ""))
    assert kept["if"] == "always()"
    assert all(Path(path).exists() for path in kept["with"]["path"].split())


def commands(text: str) -> list[list[str]]:
    """Calls of the program in a script, without where they put what they tell."""
    joined = re.sub(r"\\\n\s*", " ", text)
    found = re.findall(r"^\s*(auvident [^;\n]*)", joined, re.MULTILINE)
    return [re.sub(r"--summary \S+", "", call).split() for call in found]


def test_the_jobs_of_both_services_are_the_same() -> None:
    (github,) = yaml.safe_load((RECIPES / "github-workflow.yml").read_text())["jobs"].values()
    gitlab = yaml.safe_load((RECIPES / "gitlab-ci.yml").read_text())["identify"]
    steps = "\n".join(s["run"] for s in github["steps"] if "run" in s)
    script = "\n".join(line.replace("; then ", "; then\n") for line in gitlab["script"])
    assert commands(script) == commands(steps)
    for line in gitlab["script"]:
        assert subprocess.run(["bash", "-n", "-c", line]).returncode == 0


def rules(text: str) -> dict[str, dict[str, str]]:
    """The rules of a Snakefile with their parts, as they are written."""
    found = {}
    for name, body in re.findall(r"^rule (\w+):\n((?:(?: {4}.*)?\n)+)", text, re.MULTILINE):
        parts = re.findall(r"^ {4}(\w+):(.*\n(?:(?: {8}.*)?\n)*)", body, re.MULTILINE)
        found[name] = {key: value.strip() for key, value in parts}
    return found


def shell_of(rule: dict[str, str], **known: str) -> list[str]:
    """The command of a rule, in which the names that Snakemake knows are replaced."""
    text = "".join(re.findall(r'"([^"]*)"', rule["shell"])).replace(" 2> {log}", "")
    for name, value in known.items():
        text = text.replace(f"{{{name}}}", value)
    return [word for word in shlex.split(text) if "AUVIDENT_THREADS" not in word]


def known(trial: str) -> dict[str, str]:
    return {"wildcards.trial": trial, "input.vehicle": SAMPLE["VEHICLE"], "LOGS": "sample_logs"}


def test_the_rules_of_the_snakefile_run(demo: Path, auvident: Callable[..., Called]) -> None:
    found = rules((RECIPES / "Snakefile").read_text())
    assert list(found) == ["all", "identify", "compare"]
    demo.rename("runs/harbour_trial")
    shutil.copytree("runs/harbour_trial", "runs/other")
    one = shell_of(found["identify"], **known("harbour_trial"))
    assert auvident(*one[1:]).code == 0
    for name in re.findall(r'="(runs/[^"]+)"', found["identify"]["output"]):
        assert Path(name.format(trial="harbour_trial")).exists()
    both = {"params.runs": "runs/harbour_trial runs/other", "output": "runs/compared.md"}
    assert auvident(*shell_of(found["compare"], **both)[1:]).code == 0
    assert "| r |" in Path("runs/compared.md").read_text()


@pytest.mark.skipif(not shutil.which("snakemake"), reason="snakemake is not installed")
def test_snakemake_knows_what_to_do(tmp_path: Path) -> None:
    for trial in ("a", "b"):
        (tmp_path / "logs" / trial).mkdir(parents=True)
        (tmp_path / "logs" / trial / "dvl.csv").touch()
    (tmp_path / "vehicle.toml").touch()
    shutil.copy(RECIPES / "Snakefile", tmp_path)
    done = subprocess.run(
        ["snakemake", "--dry-run", "--cores", "1", "--printshellcmds"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        env={k: v for k, v in os.environ.items() if k != "PYTHONPATH"},
    )
    told = done.stdout + done.stderr
    assert done.returncode == 0, told
    assert "auvident run logs/a --vehicle vehicle.toml --run runs/a" in told
    assert "auvident compare runs/a runs/b --summary runs/compared.md" in told
