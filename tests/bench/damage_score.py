"""What became of a damaged trial: right, refused, said, or quietly wrong.

The coefficients are held against those of the clean log, and what the program tells against what
it told of the clean log: what it says of a clean log as well names no damage.
"""

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from tests.bench.damage_names import ACCUSING, DOUBTS, TESTED_BY, any_of, mentions, names_it

Evidence = Mapping[str, Any]

INPUT_ERROR = 3  # exit code of a log or file that cannot be used
INFORMED = 0.5  # share of the data in a coefficient, from which it is compared
FAR_STDS, NEAR_STDS = 2.0, 4.0
WIDENED = 2.0  # times its standard deviation: a log that lost maneuvers knows less
NOT_IDENTIFIED = 99.0  # standard deviations, of a coefficient that is not identified any more
HELD_OUT = 1.3  # times the error of the clean log's model
FEW = 10  # rows that may go without a word
COUNTED_SHARE = 0.5  # of the rows lost, dropped or in a gap
FIGURE_S, FIGURE_SHARE = 0.3, 0.2  # by which the offset of a clock may be told wrong
MORE = 1.5  # times the figure of the clean log's finding: another finding

# Every outcome, from good to bad, and what it means.
OUTCOMES = {
    "right": "coefficients of the informed terms within 2 standard deviations of those of the "
    "clean log, and the error on the clean log's held-out maneuvers within 1.3 times that of its "
    "own model; what was lost is counted",
    "refused": "exit code 3, with a remedy",
    "said": "a finding, shown in the terminal and kept in the run directory, names channel and "
    "kind of the fault",
    "untested": "wrong; the first line of the ingest names this quantity as one that nothing in "
    "the log tests, or not as closely as the fault is small",
    "near": "as right, but within 4 standard deviations; nothing is said",
    "counted": "beyond that; most of the spoilt readings were dropped and counted, no finding says "
    "that the result is not to be trusted",
    "uncounted": "right, but rows were lost and nothing says so",
    "gave up": "another exit code, with a message",
    "doubted": "wrong; a finding says that model and data or geometry contradict each other, none "
    "why",
    "misnamed": "wrong, and the program names another fault",
    "quiet": "wrong, and nothing is said",
    "failed": "a traceback, or no end within 5 minutes",
}
LIMITS_OF_TESTS = ("untested", "coarse")  # what the first line says of its own tests
UNTOLD = {"shift": "clock_", "drift": "drift_"}  # kinds whose sizes these checks have
REFUSED = "refused"
DOUBTFUL = ("near", "counted", "doubted", "quiet")  # better where the quantity was left open
WELL = ("right", "refused", "said", "untested")
QUIETLY_WRONG = ("misnamed", "quiet")


@dataclass(frozen=True)
class Row:
    """One damaged trial, judged.

    named : new findings, checks and effects, by code
    stds : largest difference of an informed coefficient in standard deviations, None without any
    ratio : error on the clean log's held-out maneuvers over that of its own model
    """

    key: str
    seed: int
    damage: tuple[str, ...]
    outcome: str
    best: str
    named: tuple[str, ...]
    message: str
    stds: float | None
    worst: str
    ratio: float | None
    lost: int

    @property
    def as_best(self) -> bool:
        """Whether no better outcome could be had."""
        return self.outcome == self.best or self.outcome == "right"


def judge(evidence: Evidence, clean: Evidence, cases: Iterable[Any]) -> Row:
    """Outcome of a trial with damage of some cases."""
    cases = tuple(cases)
    told = [t for t in news(evidence, clean) if t["kind"] not in LIMITS_OF_TESTS]
    shown = [t for t in evidence.get("told", []) if t["shown"]]
    left_open = [t for t in shown if leaves_open(t, cases[0], clean)]
    naming = [t for t in told if any(names(t, case) for case in cases)]
    stds, worst = difference(evidence, clean)
    outcome = _outcome(evidence, clean, told, naming, stds)
    if left_open and len(cases) == 1 and outcome in DOUBTFUL:
        outcome, naming = "untested", left_open
    case = evidence["case"]
    blamed = [t for t in told if accuses(t)]
    doubts = [t for t in told if any_of(t["code"], DOUBTS)]
    message = (naming or blamed or doubts or [{"message": ""}])[0]["message"]
    return Row(
        key=case["key"],
        seed=case["seed"],
        damage=tuple(case["damage"]),
        outcome=outcome,
        best=max((c.kind.best for c in cases), key=("right", "said", "refused").index),
        named=tuple(dict.fromkeys(t["code"] for t in told)),
        message=last_line(evidence["error"]) if evidence.get("error") else message,
        stds=stds,
        worst=worst,
        ratio=evidence.get("ratio"),
        lost=evidence.get("lost", 0),
    )


def leaves_open(telling: Evidence, case: Any, clean: Evidence) -> bool:
    """Whether the first line says that the quantity is not tested, or not as closely as that.

    What a log can test does not hang on its faults: it is said of the clean log as well, and
    where that says how closely, the fault has no say in it.
    """
    if telling["kind"] not in LIMITS_OF_TESTS:
        return False
    tests = TESTED_BY.get(case.kind.fault, ())
    about = f"{telling['code']}@" in tests and mentions(telling, case.kind.sensor)
    if telling["code"] not in tests and not about:
        return False
    return telling["kind"] == "untested" or _is_within(_closest(telling, clean), case)


def _closest(telling: Evidence, clean: Evidence) -> Evidence:
    """What is said of a coarse test, here or of the clean log, whichever is closer."""
    alike = [t for t in clean.get("told", []) if _is_same_test(t, telling)]
    values = [t["value"] for t in (telling, *alike) if t["value"] is not None]
    return {**telling, "value": min(values, default=None)}


def _is_same_test(one: Evidence, other: Evidence) -> bool:
    return (one["kind"], one["code"]) == (other["kind"], other["code"])


def _is_within(telling: Evidence, case: Any) -> bool:
    """Whether a fault is so small that a coarse test does not tell it.

    Seconds of a clock, ppm of one, a factor; None where nothing is too large.
    """
    size = abs(case.size or 0.0)
    unit = next((k for k, start in UNTOLD.items() if telling["code"].startswith(start)), "")
    if unit and not case.kind.id.startswith(unit):
        return False
    if not unit:
        if size == 0.0 or not case.kind.fault.startswith("scale"):
            return False
        size = max(size, 1.0 / size)
    return telling["value"] is None or size <= telling["value"]


def names(telling: Evidence, case: Any) -> bool:
    """Whether a finding names the fault, and not with a figure that misleads."""
    if not names_it(telling, case.kind.fault, case.kind.sensor):
        return False
    if not case.kind.figure or telling["value"] is None:
        return True
    size = abs(case.size)
    return bool(abs(abs(telling["value"]) - size) <= max(FIGURE_S, FIGURE_SHARE * size))


def _outcome(
    evidence: Evidence,
    clean: Evidence,
    told: list[Evidence],
    naming: list[Evidence],
    stds: float | None,
) -> str:
    if evidence.get("error"):
        return failure(evidence, bool(naming))
    if agrees(stds, evidence.get("ratio"), FAR_STDS):
        return "right" if naming or counted(evidence, clean) else "uncounted"
    if any(t["kind"] != "count" for t in naming):
        return "said"
    if any(accuses(t) for t in told):
        return "misnamed"
    if any(any_of(t["code"], DOUBTS) for t in told):
        return "doubted"
    if agrees(stds, evidence.get("ratio"), NEAR_STDS):
        return "near" if counted(evidence, clean) else "uncounted"
    return "counted" if naming else "quiet"


def agrees(stds: float | None, ratio: float | None, limit: float) -> bool:
    """Whether a model is that of the clean log: in its coefficients and in what it predicts.

    A log that leaves much to the prior has wide standard deviations, in which a model may well
    predict much worse; and a coefficient may move that no prediction hangs on.
    """
    if stds is None or stds > limit:
        return False
    return stds == 0.0 or (ratio is not None and ratio <= HELD_OUT)


def accuses(telling: Evidence) -> bool:
    """Whether it blames something: a check or finding of the ingest, or an effect."""
    found = telling["stage"] == "ingest" and any_of(telling["code"], ACCUSING)
    return found or telling["kind"] == "effect"


def failure(evidence: Evidence, named: bool) -> str:
    """Outcome of a chain that did not come to its end."""
    code = evidence.get("exit_code")
    if code is None:
        return "failed"
    if code == INPUT_ERROR and evidence.get("remedy"):
        return "refused"
    return "said" if named else "gave up"


def news(evidence: Evidence, clean: Evidence) -> list[dict[str, Any]]:
    """What is told, and shown, of the damaged log and not of the clean one."""
    known: dict[str, list[Evidence]] = {}
    for telling in clean.get("told", []):
        known.setdefault(_subject(telling), []).append(telling)
    told = [
        dict(t)
        for t in evidence.get("told", [])
        if t["shown"] and not _is_old(t, known.get(_subject(t), []))
    ]
    return [*told, *_losses(evidence, clean), *_effects(evidence, clean)]


def _subject(telling: Evidence) -> str:
    """Code and words of a finding, without figures."""
    words = re.sub(r"[-+]?\d[\d.,:e+-]*", "#", telling["message"])
    return f"{telling['code']}: {words}"


def _is_old(telling: Evidence, known: list[Evidence]) -> bool:
    """Whether the clean log has this finding, with a figure of that size."""
    for other in known:
        a, b = telling["value"], other["value"]
        if a is None or b is None or abs(a) <= MORE * abs(b):
            return True
    return False


def _losses(evidence: Evidence, clean: Evidence) -> list[dict[str, Any]]:
    """Reasons under which far more readings went than in the clean log."""
    found = []
    for sensor, reasons in evidence.get("dropped", {}).items():
        before = clean.get("dropped", {}).get(sensor, {})
        for reason, count in reasons.items():
            if count - before.get(reason, 0) >= enough(evidence):
                words = f"{count} readings of {sensor} dropped: {reason}"
                found.append(_telling("count", f"dropped:{reason}", words, sensor))
    return found


def _effects(evidence: Evidence, clean: Evidence) -> list[dict[str, Any]]:
    before = set(clean.get("effects", []))
    return [
        _telling("effect", f"effect:{e}", f"diagnose names {e}", "")
        for e in evidence.get("effects", [])
        if e not in before
    ]


def _telling(kind: str, code: str, message: str, where: str) -> dict[str, Any]:
    telling = {"kind": kind, "stage": "diagnose" if kind == "effect" else "counts", "code": code}
    return {**telling, "message": message, "where": where, "value": None, "shown": True}


def enough(evidence: Evidence) -> float:
    """Rows that have to be counted."""
    return max(FEW, COUNTED_SHARE * evidence.get("lost", 0))


def counted(evidence: Evidence, clean: Evidence) -> bool:
    """Whether rows that were lost are in the quality report: dropped, or in a gap."""
    if evidence.get("lost", 0) <= FEW:
        return True
    gaps, before = evidence.get("gaps", {}), clean.get("gaps", {})
    wider = any(length > before.get(sensor, 0.0) + 1.0 for sensor, length in gaps.items())
    return wider or bool(_losses(evidence, clean))


def difference(evidence: Evidence, clean: Evidence) -> tuple[float | None, str]:
    """Largest difference of a coefficient that the data inform, in standard deviations."""
    mine = evidence.get("coefficients") or {}
    worst, where = None, ""
    for symbol, (value, std, share) in (clean.get("coefficients") or {}).items():
        if share < INFORMED or not mine:
            continue
        if symbol not in mine:
            return NOT_IDENTIFIED, symbol
        scale = min(max(std, mine[symbol][1]), WIDENED * std)
        off = abs(mine[symbol][0] - value) / scale
        if worst is None or off > worst:
            worst, where = off, symbol
    return worst, where


def last_line(text: str) -> str:
    """Of a traceback, what it ends with."""
    lines = text.strip().splitlines()
    return lines[-1] if text.startswith("Traceback") else lines[0]


def false_alarms(clean: Evidence) -> list[str]:
    """Checks that contradict, findings that accuse, and readings dropped for new reasons.

    Of a log that is refused the check that its remedy would silence, or that it is refused.
    """
    if clean.get("error"):
        fix = re.search(r"--fix (\w+)", clean.get("remedy") or "")
        return [fix[1] if fix else REFUSED]
    ingest = [t for t in clean.get("told", []) if t["stage"] == "ingest"]
    told = [t["code"] for t in ingest if t["kind"] not in LIMITS_OF_TESTS]
    checks = {t["code"] for t in clean.get("told", []) if t["kind"] == "check"}
    reasons = {r for rows in clean.get("dropped", {}).values() for r in rows}
    new = reasons - {"empty", "repeated_time", "backward_time", "outlier", "marked_invalid"}
    new -= {"incomplete_last_row"}
    accused = {code for code in told if code in checks or any_of(code, ACCUSING)}
    return sorted(accused | {f"dropped:{reason}" for reason in new})
