"""The benchmarks write their own sections of docs/benchmarks.md, and nothing else."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

from auvident.schema.artifacts import ManeuverMetrics
from tests import loop_world
from tests.bench import __main__ as bench
from tests.bench import effects, samples, written
from tests.bench.effects_cases import cases
from tests.command_line import ROOT
from tests.test_bench_effects import outcome_with

PAGE = """# Benchmarks

<!-- begin speed -->
old | table
<!-- end speed -->

Words of a person.

<!-- begin effects -->
<!-- end effects -->
Last line.
"""
TABLES = {"one pass": [{"pass": "a|b", "ratio": 123.456, "bar": ""}]}


@pytest.fixture
def page(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    file = tmp_path / "benchmarks.md"
    file.write_text(PAGE)
    monkeypatch.setattr(written, "PAGE", file)
    return file


def test_only_the_own_section_is_replaced_and_a_second_time_changes_nothing(page: Path) -> None:
    written.write("speed", "Medians.", TABLES)
    once = page.read_text()
    assert "old | table" not in once and "| a\\|b | 123 |  |" in once and "Medians." in once
    own = re.compile(r"(?<=<!-- begin speed -->\n).*(?=<!-- end speed -->)", re.DOTALL)
    assert own.sub("", once) == own.sub("", PAGE)
    written.write("speed", "Medians.", TABLES)
    assert page.read_text() == once
    written.write("effects", "Trials.", {"bars": [{"what": "x", "found": 0.5}]})
    assert "| a\\|b | 123 |  |" in page.read_text() and "| x | 0.5 |" in page.read_text()
    assert page.read_text().endswith("<!-- end effects -->\nLast line.\n")


def test_a_backslash_in_a_table_is_no_escape(page: Path) -> None:
    written.write("speed", r"\1 \g<0>", {})
    assert r"\1 \g<0>" in page.read_text()


@pytest.mark.parametrize("text", ["", "<!-- begin speed -->\n", PAGE + PAGE])
def test_a_page_without_the_one_place_is_left_as_it_is(page: Path, text: str) -> None:
    page.write_text(text)
    with pytest.raises(ValueError, match="speed"):
        written.write("speed", "Medians.", TABLES)
    assert page.read_text() == text


def test_every_part_has_its_section() -> None:
    page = ROOT / "docs" / "benchmarks.md"
    parts = (*bench.PARTS, *bench.BY_HAND, *bench.STUDIES, *bench.OF_A_STUDY)
    for name in parts:
        text = page.with_name(written.ELSEWHERE.get(name, page.name)).read_text()
        assert len(re.findall(written.PLACE.format(name=name), text, re.DOTALL)) == 1, name
    own = len(parts) - len(written.ELSEWHERE)
    assert len(re.findall("<!-- begin ", page.read_text())) == own


def test_a_part_writes_its_tables_and_with_what(page: Path, monkeypatch, capsys) -> None:
    monkeypatch.setattr(bench, "_run", lambda part, repeats, seeds: TABLES)
    bench.main(["speed", "--repeats", "3", "--write"])
    assert "a|b" in capsys.readouterr().out
    text = page.read_text()
    assert effects.program(whole=True) in text and "medians of 3 repetitions" in text
    assert "| pass | ratio | bar |" in text


def test_a_part_that_measured_nothing_leaves_the_section(page: Path, monkeypatch) -> None:
    monkeypatch.setattr(bench, "_run", lambda part, repeats, seeds: {"one pass": []})
    bench.main(["speed", "--write"])
    assert page.read_text() == PAGE


def test_the_recovery_is_written_in_short(page: Path, monkeypatch) -> None:
    row = {"n": 3, "mean": 0.1, "mean_square": 0.9, "low": 0.8, "high": 1.2, "coverage": 0.95}
    claims = {"X_uu": {**row, "coverage": 0.93}, "Y_uv": {**row, "coverage": 0.98}}
    claims |= {"combinations": {**row, "mean_square": 1.18}, "all coefficients": row}
    found = {"refined ekf": {"failed": 1, "claimed": claims, "filter_own": claims}}
    page.write_text(PAGE.replace("speed", "recovery"))
    monkeypatch.setattr(bench, "_run", lambda part, repeats, seeds: found)
    bench.main(["recovery", "--seeds", "7", "--write"])
    text = page.read_text()
    assert "7 trials, seeds 0 to 6" in text
    (line,) = [line for line in text.splitlines() if line.startswith("| refined ekf")]
    assert "93.0 to 98.0 %" in line and "1.18" in line and "| 1 |" in line


def test_the_study_of_effects_writes_seeds_number_and_program(page, monkeypatch, tmp_path) -> None:
    kept, wanted = tmp_path / "kept.jsonl", cases(7000, only=["none"])[:3]
    for case in wanted[:2]:
        old = outcome_with([], found=loop_world.nothing, kind="none")
        old["case"] |= {"key": case.key, "vehicle": case.vehicle}
        effects.append(kept, {**old, "program": "0123456789abcdef"})
    command = ["effects", "--seed-base", "7000", "--only", "none", "--score", str(kept), "--write"]
    bench.main([*command, "--trials", "3"])
    text = page.read_text()
    assert "0123456789abcdef" in text and effects.program() not in text
    assert f"2 of 3 trials, seeds {wanted[0].seed} to {wanted[-1].seed}" in text
    assert "| none | 2 | none_found 2 |" in text and "old | table" in text
    bench.main([*command, "--trials", "2"])
    assert "2 trials, seeds" in page.read_text()


def test_a_study_without_outcomes_leaves_the_section(page: Path, tmp_path: Path) -> None:
    bench.main(["effects", "--score", str(tmp_path / "nothing.jsonl"), "--write"])
    assert page.read_text() == PAGE


# --- the samples --------------------------------------------------------------------------


def test_the_loop_on_a_trial_is_told_in_one_row(monkeypatch) -> None:
    made = loop_world.put_in_place(monkeypatch)
    row = samples._closed(ROOT / "sample_logs/bay_trial", ROOT / "sample_logs/tern180.toml")
    assert made.calls and row["trial"] == "bay_trial" and row["verdict"] == "effect_found"
    assert row["used"] == "current" and re.fullmatch(r"\d\.\d{3}, \d\.\d{3}", row["u"])


def test_overshoots_of_a_zigzag_without_a_virtual_one() -> None:
    maneuver = ManeuverMetrics(
        id="z-zigzag-1",
        trial="z",
        kind="zigzag",
        role="validate",
        duration_s=60.0,
        channels={},
        zigzag={"measured": {"overshoot_1_deg": 3.2}, "simulated": {"overshoot_1_deg": 3.0}},
    )
    row = samples._overshoots(maneuver)
    assert row["zigzag"] == "z" and row["overshoot_1_deg measured"] == 3.2
    assert row["overshoot_2_deg measured"] == row["overshoot_1_deg virtual"] == "-"


def test_left_out_errors_stand_with_their_standard_errors() -> None:
    row = {"rmse": 0.02, "nrmse": 0.25, "se": 0.004, "unit": "m/s"}
    told = {"before": {"v": row, "track": row}, "after": {"v": row | {"nrmse": 0.2}}}
    (found,) = samples._crossed({"cross_validation": told})
    assert found == {"channel": "v", "before": "0.250 ± 0.050", "after": "0.200 ± 0.040"}


def test_the_bench_of_the_whole_vehicle_needs_no_pytest() -> None:
    code = "import sys; sys.modules['pytest'] = None; import tests.bench.whole"
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
