"""What the documentation owes to the program: pages it writes, references, versions, links."""

import json
import re
import subprocess
import sys
import tomllib
from pathlib import Path
from urllib.parse import unquote

import numpy as np
import pandas as pd
import pytest
from PIL import Image

import auvident
from auvident.cli import COMMANDS
from auvident.pipeline.table import STAGES
from auvident.schema.coefficients import symbols_of
from auvident.schema.effects import EFFECTS
from tests.bench import headline, pages, reference, report_picture, signatures
from tests.command_line import ENVIRONMENT, ROOT, call
from tests.engines.effects_world import HEADING

DOCS = ROOT / "docs"
PAGES = [ROOT / "README.md", *sorted(DOCS.glob("*.md"))]
MOST_LINES, MOST_BYTES = 200, 150_000  # of the README; of a picture
MOST_OF_A_SIGNATURE, MOST_OF_SIGNATURES = 15_000, 400_000
COMMANDS_OF_PROGRAM = {name for names in COMMANDS.values() for name in names}


def test_the_readme_can_be_finished() -> None:
    assert len((ROOT / "README.md").read_text().splitlines()) <= MOST_LINES


def test_what_the_readme_says_of_trust_is_what_the_studies_measured() -> None:
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    assert headline.section() in text, "run `python -m tests.bench.headline`"


def test_the_page_of_effects_is_what_the_program_prints() -> None:
    text = (DOCS / "effects.md").read_text(encoding="utf-8")
    assert text == pages.effects_page(), "run `make docs`"
    assert call("effects").out in text
    assert all(f"| `{effect.id}` |" in text for effect in EFFECTS)


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.name)
def test_links_lead_somewhere(page: Path) -> None:
    """Files beside the page, and headings in them as GitHub names them."""
    text = page.read_text(encoding="utf-8")
    for target in re.findall(r"\]\(([^)\s]+)\)", text):
        if re.match(r"[a-z]+:", target):
            continue
        name, _, heading = unquote(target).partition("#")
        file = page.parent / name if name else page
        assert file.exists(), target
        assert not heading or heading in headings(file), target


def headings(page: Path) -> set[str]:
    """Anchors of a page."""
    text = re.sub(r"^```.*?^```", "", page.read_text(encoding="utf-8"), flags=re.M | re.S)
    found = re.findall(r"^#+ (.+)$", text, re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", h.lower()).replace(" ", "-") for h in found}


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.name)
def test_paths_of_the_project_that_a_page_names_exist(page: Path) -> None:
    named = set(re.findall(r"`((?:auvident|tests|sample_logs|docs)/[\w./*-]+)`", page.read_text()))
    missing = [
        p for p in named if not (any(ROOT.glob(p.rstrip("/"))) if "*" in p else (ROOT / p).exists())
    ]
    assert not missing


def test_every_page_is_within_reach_of_the_readme() -> None:
    """By its links to other pages, and by theirs."""
    reached, ahead = set(), {ROOT / "README.md"}
    while ahead:
        page = ahead.pop()
        reached.add(page)
        links = re.findall(r"\]\(([\w/-]+\.md)[#)]", page.read_text(encoding="utf-8"))
        ahead |= {(page.parent / link).resolve() for link in links} - reached
    assert set(PAGES) <= reached


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.name)
def test_no_page_names_a_place_of_some_machine(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    assert not re.findall(r"(?<![\w.])/(?:home|root|tmp|work|opt|usr|Users)/\S*|C:\\\S*", text)


# --- the site -----------------------------------------------------------------------------


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Built as `make site` does: a broken link or a page that is not in the menu fails."""
    pytest.importorskip("material")
    folder = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", str(folder)]
    done = subprocess.run(command, cwd=ROOT, env=ENVIRONMENT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return folder


def test_the_site_has_every_page(site: Path) -> None:
    assert {p.stem for p in PAGES[1:]} <= {p.stem for p in site.glob("*.html")}


def test_the_site_needs_no_network(site: Path) -> None:
    """Nothing that a browser loads by itself lies elsewhere, and equations need no script."""
    for page in site.rglob("*.html"):
        text = page.read_text(encoding="utf-8")
        loaded = re.findall(r"<(?:script|img|link|iframe)\b[^>]*?(?:src|href)=\"([^\"]+)", text)
        assert not [url for url in loaded if re.match(r"(?:https?:)?//", url)], page.name
        assert "```" not in re.sub(r"<(pre|code)\b.*?</\1>", "", text, flags=re.S), page.name
    for style in site.rglob("*.css"):
        assert "url(http" not in style.read_text(encoding="utf-8")


@pytest.mark.skipif(report_picture.browser() is None, reason="no Chromium")
def test_the_search_works_from_a_disk(site: Path, tmp_path: Path) -> None:
    """Where browsers start no worker: `docs/iframe-worker.js` stands in for one."""
    page = f"{(site / 'index.html').as_uri()}?q=zigzag"
    options = ("--headless", "--no-sandbox", "--disable-gpu", f"--user-data-dir={tmp_path}")
    waited = ("--virtual-time-budget=15000", "--dump-dom", page)
    done = subprocess.run(
        [report_picture.browser() or "", *options, *waited], capture_output=True, text=True
    )
    (found,) = re.findall(r'search-result__meta">\s*(\d+) matching', done.stdout)
    assert int(found) > 3


def test_equations_are_drawn_by_the_browser(site: Path) -> None:
    text = (site / "equations.html").read_text(encoding="utf-8")
    source = (DOCS / "equations.md").read_text(encoding="utf-8")
    blocks, within = source.count("```math"), len(re.findall(r"\$`[^`]+`\$", source))
    assert text.count('display="block"') == blocks > 10
    assert text.count("<math ") == blocks + within
    assert not re.search(r"<mi>\\|merror|&amp;=|<mi>&amp;", text)  # what was not understood


def test_every_coefficient_stands_in_the_equations() -> None:
    text = (DOCS / "equations.md").read_text(encoding="utf-8")
    for symbol in symbols_of("horizontal"):
        axis, _, index = symbol.partition("_")
        index = re.sub(r"(\w)dot", r"\\dot \1", index).replace("d", r"\delta")
        index = index.replace(r"\\deltaot", r"\dot").replace(r"\deltaot", r"\dot")
        assert f"{axis}_{{{index}}}" in text, symbol


# --- what the program says of itself --------------------------------------------------------


@pytest.mark.parametrize("name", pages.WRITTEN_PAGES)
def test_pages_of_the_program_are_up_to_date(name: str) -> None:
    assert (DOCS / name).read_text(encoding="utf-8") == pages.WRITTEN_PAGES[name](), "make docs"


def test_findings_that_pages_send_people_to_are_listed() -> None:
    """Codes that people are sent to look up; every one says something."""
    told = reference.findings()
    codes = {t.code for t in told}
    assert all(t.message.strip("… ") for t in told)
    for page in ("when-not-to-trust-it.md", "own-vehicle.md", "reading-the-report.md"):
        named = set(re.findall(r"`([a-z]+(?:-[a-z]+)+)`", (DOCS / page).read_text()))
        assert named <= codes | COMMANDS_OF_PROGRAM, page


def test_every_artifact_is_in_the_table_of_the_run_directory() -> None:
    text = (DOCS / "run-directory.md").read_text(encoding="utf-8")
    assert all(f"`{file}`" in text for stage in STAGES for file in stage.writes)


# --- pictures of effects --------------------------------------------------------------------


def test_every_effect_has_a_picture_or_a_reason() -> None:
    drawn = [e for group in signatures.GROUPS.values() for e in group.effects]
    assert sorted([*drawn, *signatures.NO_PICTURE]) == sorted(effect.id for effect in EFFECTS)
    files = {file.stem: file.stat().st_size for file in (DOCS / pages.SIGNATURES).glob("*.svg")}
    assert files.keys() == signatures.GROUPS.keys()
    assert max(files.values()) < MOST_OF_A_SIGNATURE
    assert sum(files.values()) < MOST_OF_SIGNATURES


@pytest.mark.parametrize("group", ["current", "pitch-rate"])
def test_a_picture_of_an_effect_is_that_of_the_program(group: str) -> None:
    """Points are whole numbers of a quarter of a px; rounding may go either way."""
    shown = (DOCS / pages.SIGNATURES / f"{group}.svg").read_text(encoding="utf-8")
    now = signatures.picture(group)
    number = r"-?\d+(?:\.\d+)?"
    assert re.sub(number, "0", shown) == re.sub(number, "0", now), "run `make docs`"
    numbers = [np.array(re.findall(number, text), dtype=float) for text in (shown, now)]
    np.testing.assert_allclose(*numbers, atol=2.0)


def test_a_signature_is_the_effect_where_nothing_answers() -> None:
    """In a straight run the gyro reads its bias more, the DVL the current as the heading has it."""
    bias = signatures.flown("gyro", "gyro_bias", 0)[-1, 2]
    assert bias == pytest.approx(np.radians(0.2), rel=0.01)
    drift = signatures.flown("current", "current", 0)[-1]
    heading = drift[3] + HEADING
    north, east = 0.1, -0.1
    over = (
        north * np.cos(HEADING) + east * np.sin(HEADING),
        -north * np.sin(HEADING) + east * np.cos(HEADING),
    )
    assert np.hypot(*drift[:2]) == pytest.approx(np.hypot(*over), rel=0.05), heading


def test_the_citation_has_the_version_of_the_package() -> None:
    text = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    (version,) = re.findall(r"^version: (\S+)$", text, re.MULTILINE)
    assert version.strip('"') == project["version"] == auvident.__version__
    assert re.search(rf"^license: {project['license']}$", text, re.MULTILINE)


# --- the picture --------------------------------------------------------------------------


def run_directory(folder: Path) -> Path:
    """The files of a run that the picture needs; the prediction before is off by 0.1."""
    time = np.arange(0.0, 30.0, 0.1)
    measured = {
        "u_mps": 1.5 + 0.1 * np.sin(time),
        "v_mps": 0.1 * np.cos(time),
        "r_radps": 0.1 * np.sin(0.3 * time),
    }
    for stage, off in (("validate", 0.1), ("refine", 0.0)):
        (folder / stage).mkdir(parents=True)
        rows = {"maneuver": "turn-1", "role": "validate", "time_s": 100.0 + time}
        for column, values in measured.items():
            rows |= {f"{column}_measured": values, f"{column}_simulated": values + off}
        pd.DataFrame(rows).to_parquet(folder / stage / "simulation.parquet")
    errors = {c: {"rmse": 0.1, "nrmse": 0.9, "unit": "m/s"} for c in ("u", "v", "r")}
    held_out = {"maneuvers": ["turn-1"], "before": errors, "after": errors}
    (folder / "refine/comparison.json").write_text(json.dumps({"held_out": held_out}))
    return folder


def test_the_picture_is_made_from_a_run_and_comes_out_the_same(tmp_path: Path) -> None:
    run = run_directory(tmp_path / "run")
    first = pages.picture(run)
    assert first == pages.picture(run)
    assert first.startswith("<?xml") and "turn-1" in first and "NRMSE 0.90" in first
    assert all(words in first for words in ("measured", "identified", "with the effect"))


def test_pages_are_written_where_they_belong(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setattr(pages, "DOCS", tmp_path)
    pages.main([])
    assert {p.name for p in tmp_path.iterdir()} == {*pages.WRITTEN_PAGES, "img"}
    assert {p.stem for p in (tmp_path / pages.SIGNATURES).iterdir()} == set(signatures.GROUPS)
    pages.main([str(run_directory(tmp_path / "run"))])
    assert (tmp_path / "img" / "held_out.svg").is_file()
    pages.main([str(run_directory(tmp_path / "tanker"))])
    assert (tmp_path / "img" / "tanker.svg").is_file()


@pytest.mark.parametrize("file", sorted((DOCS / "img").glob("*")), ids=lambda p: p.name)
def test_pictures_are_small(file: Path) -> None:
    assert file.stat().st_size < MOST_BYTES


@pytest.mark.parametrize("name", ["held_out", *pages.PICTURES.values()])
def test_there_is_a_picture(name: str) -> None:
    assert f"](docs/img/{name}.svg)" in (ROOT / "README.md").read_text()


def test_the_report_has_a_picture() -> None:
    assert "](docs/img/report.png)" in (ROOT / "README.md").read_text()
    with Image.open(DOCS / "img" / "report.png") as image:
        assert image.size == report_picture.SIZE


@pytest.mark.skipif(report_picture.browser() is None, reason="no Chromium")
def test_the_picture_of_a_report_is_drawn_by_a_browser(tmp_path: Path) -> None:
    (tmp_path / "a page.html").write_text("<body style='background:#c00'><h1>Summary")
    report_picture.write(tmp_path / "a page.html", tmp_path / "report.png")
    with Image.open(tmp_path / "report.png") as image:
        assert image.size == report_picture.SIZE
        assert image.convert("RGB").getpixel((5, 5)) == (0xCC, 0, 0)


def test_tables_and_columns_that_contributors_are_sent_to_exist() -> None:
    """Names of tables in capitals, and the columns of an effect."""
    text = (DOCS / "contributing.md").read_text(encoding="utf-8")
    source = [
        p.read_text(encoding="utf-8")
        for f in ("auvident", "tests", "sample_logs")
        for p in (ROOT / f).rglob("*.py")
    ]
    named = set(re.findall(r"`([A-Z][A-Z_]{3,})`", text))
    assert {"EFFECTS", "EFFECT_FORCES"} <= named
    for name in named:
        assert any(re.search(rf"^{name}\b.*=", code, re.M) for code in source), name
    for column in ("words", "alike", "curved", "surge_alone", "higher_order", "steady", "late"):
        assert f"`{column}`" in text and hasattr(EFFECTS[0], column)
