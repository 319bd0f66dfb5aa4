"""The report has everything of a run, needs nothing else, and survives what is missing."""

import re
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest

from auvident.pipeline.given import Given
from auvident.pipeline.reporting import report_data
from auvident.report.html import _commands, render
from auvident.report.html_data import ReportData, number, quantity
from auvident.report.html_summary import grade, summary, verdict_lines
from auvident.report.html_words import cards, warnings
from auvident.report.numbers import PAGE
from auvident.report.tables import written
from auvident.report.tables_model import combination, combinations
from auvident.schema.artifacts import Combination, Finding, Maneuvers
from auvident.schema.logs import CheckMade
from auvident.stages.validate.findings import findings_of
from auvident.storage.run_directory import RunDirectory
from tests.report import drawings

MOST_BYTES = 3e6
VOID = {"meta", "br", "img", "link", "input", "hr"}
NASTY = '<b>"A" & $B$</b>'


class Page(HTMLParser):
    """Identifiers, references, text and nesting of a page."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.ids: list[str] = []
        self.references: list[str] = []
        self.tags: list[str] = []
        self.open: list[str] = []
        self.words: list[str] = []
        self.feed(text)
        self.text = " ".join(" ".join(self.words).split())

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        if tag not in VOID:
            self.open.append(tag)
        for name, value in attrs:
            if name == "id":
                self.ids.append(str(value))
            elif name in ("href", "src", "xlink:href"):
                self.references.append(str(value))

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.handle_starttag(tag, attrs)
        self.handle_endtag(tag)

    def handle_endtag(self, tag: str) -> None:
        assert tag in VOID or self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        if "nav" not in self.open:  # a heading that is linked to is not there yet
            self.words.append(data)


@pytest.fixture(scope="module")
def data(completed: Path) -> ReportData:
    run = RunDirectory(completed / "runs/demo")
    return report_data(Given(run, run.manifest(), also=frozenset({"diagnose", "refine"})))


@pytest.fixture(scope="module")
def text(data: ReportData) -> str:
    return render(data)


@pytest.fixture(scope="module")
def page(text: str) -> Page:
    return Page(text)


def test_every_maneuver_coefficient_and_rejection_is_in_it(data: ReportData, page: Page) -> None:
    assert data.maneuvers and data.model and data.maneuvers.rejected
    wanted = [m.id for m in data.maneuvers.maneuvers]
    wanted += [c.symbol for c in data.model.coefficients]
    wanted += [r.reason for r in data.maneuvers.rejected]
    wanted += [s.stage for s in data.model.stages]
    assert [w for w in wanted if w not in page.text] == []


def test_findings_of_every_stage_are_in_it(data: ReportData, page: Page) -> None:
    assert data.model and data.ase and data.model.findings and data.ase.findings
    messages = [f.message.rstrip(".") for f in (*data.model.findings, *data.ase.findings)]
    assert [m for m in messages if m not in page.text] == []


def test_what_the_data_cannot_tell_is_named(data: ReportData, page: Page) -> None:
    assert data.model and data.model.unidentifiable
    named = [" ".join(combination(c, PAGE).split()) for c in data.model.unidentifiable]
    assert [n for n in named if n not in page.text] == []
    direction = Combination(symbols=("Y_uv", "N_uv"), weights=(1.0, -0.25), information=0.0031)
    update = {"meaning": "only the ratio is seen", "information": 1e-13}
    other = direction.model_copy(update=update)
    model = data.model.model_copy(update={"unidentifiable": (direction, other)})
    rows = written(combinations(model), PAGE).rows
    assert rows[0] == ("Y_uv − 0.25 N_uv", "set by the prior", "0.0031")
    assert rows[1] == ("Y_uv − 0.25 N_uv", "only the ratio is seen", "none")


def test_held_out_errors_are_those_of_the_metrics(data: ReportData, page: Page) -> None:
    assert data.metrics
    for metrics in data.metrics.summary["validate"].values():
        assert quantity(metrics.rmse, metrics.unit).replace("\u00a0", " ") in page.text
    for maneuver in data.held_out():  # in the figure
        u = maneuver.channels["u"]
        words = f"RMSE {quantity(u.rmse, 'm/s')} · NRMSE {number(u.nrmse, 2)}"
        assert words.replace("\u00a0", " ") in page.text


def test_the_tables_of_the_field_are_in_it(data: ReportData, page: Page) -> None:
    assert data.standard and data.model
    for heading in (
        "Standard maneuvers",
        "Particulars of the vehicle",
        "Uncertainty of the coefficients after GUM",
        "Is what it leaves noise?",
        "The rules behind the words",
        "Values after each round",
    ):
        assert heading in page.text, heading
    assert "Criteria of ships" not in page.text  # a body of revolution is none
    for c in data.model.coefficients:
        assert PAGE.with_std(c.value, c.std) in page.text


def test_a_heading_that_spins_is_told_in_degrees_alone(data: ReportData) -> None:
    """The held-out circle turns more than once round."""
    assert data.metrics
    heading = next(c for c in cards(data) if c["name"] == "heading")
    assert heading["rmse"].endswith("\u00a0deg") and heading["nrmse"] == heading["r2"] == ""
    assert "%" not in heading["before"] and heading["grade"] == "none"
    assert all(c["nrmse"] for c in cards(data) if c["name"] != "heading")


def test_it_needs_no_other_file_and_no_script(text: str, page: Page) -> None:
    assert "http:" not in text and "https:" not in text
    assert not {"script", "link", "iframe", "object"} & set(page.tags)
    assert page.references and all(r.startswith(("#", "data:")) for r in page.references)
    assert all(u.startswith("#") for u in re.findall(r"url\(['\"]?([^)]*)", text))
    assert len(text.encode()) < MOST_BYTES


def test_page_is_well_formed_with_unique_identifiers(text: str, page: Page) -> None:
    assert page.open == []
    assert len(page.ids) == len(set(page.ids))
    assert {r[1:] for r in page.references if r.startswith("#")} <= set(page.ids)
    figures = re.findall(r"<svg.*?</svg>", text, flags=re.DOTALL)
    assert len(figures) >= 6
    for figure in figures:
        ElementTree.fromstring(figure)


def test_no_colour_of_the_drawing_is_left_that_dark_paper_would_hide(text: str) -> None:
    from auvident.report.figures import VARIABLES

    figures = "".join(re.findall(r"<svg.*?</svg>", text, flags=re.DOTALL))
    for colour, variable in VARIABLES.items():
        assert colour not in figures
        assert text.count(f"{variable}: #") == 3  # light, dark, print


def test_the_same_run_makes_the_same_report(data: ReportData, text: str) -> None:
    drawings.drawn.clear()
    assert render(data) == text


@pytest.mark.parametrize(
    "missing",
    [
        ("ase",),
        ("quality",),
        ("manifest",),
        ("history",),
        ("simulation",),
        ("maneuvers",),
        ("model", "history"),
        ("metrics", "simulation"),
        ("trials",),
        ("ase", "model", "history", "metrics", "simulation", "maneuvers"),
    ],
    ids=" ".join,
)
def test_missing_artifacts_leave_out_their_sections(
    data: ReportData, missing: tuple[str, ...]
) -> None:
    partial = replace(data, **{name: () if name == "trials" else None for name in missing})
    page = Page(render(partial))
    assert "REMUS 100" in page.text
    sections = {
        "quality": "Data quality",
        "history": "Coefficients through the stages",
        "model": "Coefficients: prior, data and",
        "metrics": "Error of every maneuver",
        "trials": "Trial at a glance",
        "manifest": "Record of the run",
    }
    for name, heading in sections.items():
        assert (heading in page.text) == (name not in missing), name


def test_nothing_at_all_is_a_report_that_says_so() -> None:
    assert "No model has been identified" in Page(render(ReportData())).text


def test_optional_channels_may_be_missing(data: ReportData) -> None:
    needed = ["time_s", "u_mps", "v_mps", "r_radps", "rudder_rad", "rpm", "record"]
    trials = [t.with_table(t.table[needed]) for t in data.trials]
    page = Page(render(replace(data, trials=trials)))
    assert "Trial at a glance" in page.text
    assert "measured positions" not in page.text and "dead reckoning" not in page.text
    with_heading = [t.with_table(t.table[[*needed, "heading_rad"]]) for t in data.trials]
    assert "dead reckoning" in Page(render(replace(data, trials=with_heading))).text


def test_a_single_maneuver_that_identifies(data: ReportData) -> None:
    assert data.maneuvers and data.metrics and data.metrics.ase
    one = next(m for m in data.maneuvers.maneuvers if m.role == "identify")

    def cut(metrics):  # type: ignore[no-untyped-def]
        found = tuple(m for m in metrics.maneuvers if m.id == one.id)
        summary = {"identify": found[0].channels}
        return metrics.model_copy(update={"maneuvers": found, "summary": summary})

    metrics = cut(data.metrics).model_copy(update={"ase": cut(data.metrics.ase)})
    single = replace(data, maneuvers=Maneuvers(maneuvers=(one,)), metrics=metrics)
    page = Page(render(single))
    assert "No maneuver was held out" in page.text
    assert one.id in page.text
    assert grade(single) == "poor"


def test_names_are_escaped(data: ReportData) -> None:
    assert data.model and data.maneuvers and data.metrics and data.simulation is not None

    def renamed(rows):  # type: ignore[no-untyped-def]
        old = data.trials[0].name
        return tuple(
            m.model_copy(update={"id": m.id.replace(old, NASTY), "trial": NASTY}) for m in rows
        )

    simulation = data.simulation.assign(
        maneuver=data.simulation["maneuver"].str.replace(data.trials[0].name, NASTY, regex=False)
    )
    named = replace(
        data,
        model=data.model.model_copy(update={"vehicle": NASTY}),
        trials=[replace(data.trials[0], name=NASTY)],
        maneuvers=data.maneuvers.model_copy(
            update={"maneuvers": renamed(data.maneuvers.maneuvers)}
        ),
        metrics=data.metrics.model_copy(update={"maneuvers": renamed(data.metrics.maneuvers)}),
        simulation=simulation,
    )
    text = render(named)
    assert "<b>&quot;A" not in text and '<b>"A' not in text
    assert "&lt;b&gt;" in text
    page = Page(text)
    assert page.open == []
    assert f"{NASTY}: maneuvering model" in page.text
    for figure in re.findall(r"<svg.*?</svg>", text, flags=re.DOTALL):
        ElementTree.fromstring(figure)


def judged(data: ReportData, **update: Any) -> ReportData:
    """The same with other metrics, and with what validation says of those."""
    assert data.metrics and data.model
    metrics = data.metrics.model_copy(update=update)
    found = tuple(findings_of(metrics, data.model))
    return replace(data, metrics=metrics.model_copy(update={"findings": found}))


def told(data: ReportData) -> dict[str, str]:
    """The box at the top by its words."""
    return {word: " ".join(lines) for word, lines in summary(data)}


def verdict(data: ReportData) -> str:
    return verdict_lines(data)[0]


def test_the_summary_says_how_good_where_and_what_next(data: ReportData) -> None:
    box = told(data)
    assert list(box) == [
        "Verdict",
        "Use it for",
        "Not for",
        "It lacked",
        "What remains",
        "Fly next",
    ]
    assert "predicts 3 held-out maneuvers well: RMSE u " in box["Verdict"]
    assert box["Use it for"].startswith("Speed ") and "rudder angle −20" in box["Use it for"]
    assert "how quickly the speed follows the thrust (X_udot)" in box["Not for"]
    assert data.plan
    for i, c in enumerate(data.plan.candidates[:2], 1):
        assert f"{i}. {c.name.capitalize()}: {c.what}" in box["Fly next"]
        symbol, factor = next(iter(c.shrinks.items()))
        assert f"{symbol} by {100 * (1 - factor):.0f} %" in box["Fly next"]
    bare = told(replace(data, planned=None, simulation=None, diagnosis=None, comparison=None))
    assert not {"Use it for", "It lacked", "Fly next"} & set(bare)


def test_a_contradicted_log_stands_before_all_else(data: ReportData) -> None:
    assert data.quality is not None
    (trial,) = data.quality.trials
    wrong = CheckMade(
        name="speed_scale",
        what="scale of the speed",
        against="thrust and drag",
        outcome="contradicts",
        message="u is 1.96 times what the propeller drives this hull to; knots logged as m/s?",
        fix="u_mps = 0.514444 u_mps",
    )
    bad = trial.model_copy(update={"checks_made": (wrong,)})
    quality = data.quality.model_copy(update={"trials": (bad,)})
    doubted = replace(data, quality=quality)
    (word, lines), *_ = summary(doubted)
    assert word == "Contradicted"
    assert "1.96 times" in lines[0] and "--fix speed_scale" in lines[0]
    assert told(doubted)["It lacked"].endswith("while the log is contradicted.")
    assert grade(doubted) == "poor"
    assert "Contradicted" not in told(data)


def test_verdict_follows_the_worst_velocity(data: ReportData) -> None:
    def with_nrmse(value: float) -> ReportData:
        pooled = dict(data.metrics.summary["validate"])  # type: ignore[union-attr]
        pooled["v"] = pooled["v"].model_copy(update={"nrmse": value})
        return judged(data, summary={"validate": pooled})

    assert [grade(with_nrmse(x)) for x in (0.09, 0.11, 0.31)] == ["good", "fair", "poor"]
    assert "u and r well, v fairly well: RMSE" in verdict(with_nrmse(0.11))
    assert "v worse than a constant would" in verdict(with_nrmse(1.2))
    assert "Predicted worse than a constant would: v." in told(with_nrmse(1.2))["Not for"]
    assert data.diagnosis
    row = data.diagnosis.residuals[0].model_copy(update={"channel": "v", "noise_std": 1.0})
    loud = data.diagnosis.model_copy(update={"residuals": (row,)})
    noisy = replace(with_nrmse(1.2), diagnosis=loud)  # the reading is off by less than its noise
    assert "constant would" not in told(noisy)["Not for"]
    codes = {w.finding.code: w.rank for w in warnings(with_nrmse(1.2))}
    assert codes["not-predicted"] == "serious"
    assert "not-predicted" not in {w.finding.code for w in warnings(with_nrmse(0.3))}


def test_a_heading_that_ran_round_and_round_is_neither_well_nor_badly_predicted(
    data: ReportData,
) -> None:
    def turned(nrmse: float, rmse: float) -> str:
        pooled = dict(data.metrics.summary["validate"])  # type: ignore[union-attr]
        heading = pooled["heading"].model_copy(update={"nrmse": nrmse, "rmse": rmse})
        return verdict(judged(data, summary={"validate": {**pooled, "heading": heading}}))

    assert "heading fairly well" in turned(0.2, 0.1)
    assert "(heading)" in turned(0.2, 0.1)  # with the factor of the estimate, as the others
    assert "predicts 3 held-out maneuvers well" in turned(0.2, 2.0)  # of a spread of 10 rad
    assert "(heading)" not in turned(0.2, 2.0)


def test_a_band_that_is_too_narrow_spoils_the_verdict(data: ReportData) -> None:
    assert data.metrics
    found = data.metrics.coverage

    def covered(share: float) -> ReportData:
        r = found["r"].model_copy(update={"covered": share})
        return judged(data, coverage={**found, "r": r})

    assert grade(data) == grade(covered(0.91)) == "good"
    assert (grade(covered(0.9)), grade(covered(0.75))) == ("fair", "poor")
    told = verdict(covered(0.75))
    assert "of the samples of u, v and heading: to be trusted; 75" in told
    assert "of those of r: too narrow" in told


def test_data_that_did_not_help_are_called_so(data: ReportData) -> None:
    assert data.metrics and data.metrics.ase
    ase = data.metrics.ase
    swapped = judged(data, summary=ase.summary, maneuvers=ase.maneuvers, ase=data.metrics)
    (found,) = (w for w in warnings(swapped) if w.finding.code == "no-better")
    assert "u" in found.finding.where.split("; ")
    assert found.rank == "serious"
    assert "no-better" not in {w.finding.code for w in warnings(data)}


def test_a_prior_that_ran_away_is_not_compared(data: ReportData) -> None:
    assert data.metrics and data.metrics.ase
    gone = data.held_out()[0].id
    ase = data.metrics.ase.model_copy(
        update={
            "maneuvers": tuple(m for m in data.metrics.ase.maneuvers if m.id != gone),
            "findings": (Finding(code="prediction-ran-away", message="away", where=gone),),
        }
    )
    changed = judged(data, ase=ase)
    assert "factors" in verdict(data) and "factors" not in verdict(changed)
    assert gone in next(
        w.finding.where for w in warnings(changed) if w.finding.code == "prior-ran-away"
    )
    assert gone in Page(render(changed)).text


def test_what_validation_says_of_its_run_stands_in_the_report_once(
    data: ReportData, page: Page
) -> None:
    assert data.metrics
    assert "rests-on-prior" in {f.code for f in data.metrics.findings}
    for message in {f.message for f in data.metrics.findings}:
        assert page.text.count(message) == 1


def test_a_command_in_a_remedy_is_set_as_one_and_nothing_else_is_markup() -> None:
    told = _commands("`auvident plan-trial RUN` ranks <them> & `more`")
    assert told == "<code>auvident plan-trial RUN</code> ranks &lt;them&gt; &amp; <code>more</code>"


def test_a_finding_of_several_places_has_no_value_of_one(data: ReportData) -> None:
    two = [
        Finding(code="worse-than-prior", message="worse", where=w, value=v, threshold=1.0)
        for w, v in (("turn-1 (u)", 0.5), ("turn-2 (v)", 0.9))
    ]
    assert data.metrics
    told = warnings(replace(data, metrics=data.metrics.model_copy(update={"findings": two})))
    (one,) = [w.finding for w in told if w.finding.message == "worse"]
    assert (one.where, one.value) == ("turn-1 (u); turn-2 (v)", None)


def test_gravest_findings_come_first(data: ReportData) -> None:
    assert data.metrics
    away = Finding(code="prediction-ran-away", message="it leaves every bound", where="turn-9")
    found = warnings(replace(data, metrics=data.metrics.model_copy(update={"findings": (away,)})))
    assert found[0].finding.code == "prediction-ran-away"
    ranks = [w.rank for w in found]
    assert ranks == sorted(ranks, key=["serious", "caution", "note"].index)


@pytest.mark.parametrize(
    ("value", "shown"),
    [
        (None, "–"),
        (float("nan"), "–"),
        (0.0, "0"),
        (-1.5, "−1.50"),
        (9.9996, "10.0"),
        (1234.5, "1230"),
        (0.000474, "0.000474"),
        (1.234e-9, "1.23e−09"),
        (2.5e7, "2.50e+07"),
    ],
)
def test_numbers_have_their_digits(value: float | None, shown: str) -> None:
    assert number(value) == shown


def test_angles_are_shown_in_degrees() -> None:
    assert quantity(0.1, "rad/s") == "5.73\u00a0deg/s"
    assert quantity(0.1, "m/s") == "0.100\u00a0m/s"
