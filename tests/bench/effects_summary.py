"""The study in tables: what was planted against what was named, and the bars."""

import json
from collections import Counter
from collections.abc import Iterable
from statistics import median

from tests.bench.effects_bars import (
    NEAR_S,
    Scores,
    Table,
    affected_ratio,
    bars,
    clean_errors,
    stated,
)
from tests.bench.effects_score import Score, Size, uniformity

CHANCE = "nothing planted: chance of the best candidate"


def tables(scores: Scores) -> dict[str, Table]:
    """Everything that is printed, in order."""
    return {
        "planted against named": confusion(scores),
        "by planted effect": by_effect(scores),
        "bars": bars(scores),
        CHANCE: [uniformity([s.chance for s in scores if s.kind == "none"])],
        "costs": costs(scores),
    }


def confusion(scores: Scores) -> Table:
    """Counts of verdict and names for everything that was planted."""
    return [
        {"planted": label, "n": len(rows), "named": _counted(map(answer, rows))}
        for label, rows in grouped(scores).items()
    ]


def answer(score: Score) -> str:
    """Verdict and names of one trial in a few words; a plain finding needs only its name."""
    names = " + ".join(score.named)
    if score.verdict == "effect_found":
        return names
    return f"{score.verdict}: {names}" if names else score.verdict


def _counted(words: Iterable[str]) -> str:
    return ", ".join(f"{word} {n}" for word, n in Counter(words).most_common())


def grouped(scores: Scores) -> dict[str, list[Score]]:
    """Trials by what was planted, in the order of kinds and of first appearance."""
    kinds = ("single", "pair", "outside", "none")
    found: dict[str, list[Score]] = {}
    for score in sorted(scores, key=lambda s: (kinds.index(s.kind), s.label)):
        found.setdefault(score.label, []).append(score)
    return found


def by_effect(scores: Scores) -> Table:
    """Counts by planted effect, median error of the size and ratio of the held-out error.

    ``seen``: visible; ``said``: declared; ``group``: right id, or in a stated group with it.
    """
    clean = clean_errors(scores)
    return [
        {
            "planted": label,
            "n": len(rows),
            "seen": sum(bool(s.visible) for s in rows),
            "said": sum(s.declared for s in rows),
            "id": sum(s.right_id for s in rows),
            "group": sum(s.right_or_group for s in rows),
            "family": sum(s.right_family for s in rows),
            "finding": sum(s.by_finding for s in rows),
            "wrong": sum(s.wrong_name for s in rows),
            "extra": sum(bool(s.extra) for s in rows),
            "in_95": _share(z.inside for s in rows for z in s.sizes if z.inside is not None),
            "error": _median(relative(z) for s in rows for z in s.sizes if z.planted),
            "ratio": _median(r for s in rows if (r := affected_ratio(s, clean)) is not None),
        }
        for label, rows in grouped(scores).items()
    ]


def relative(size: Size) -> float:
    """Error of a size as a share of it."""
    return abs(size.value / size.planted - 1.0)


def _share(flags: Iterable[bool]) -> str:
    flags = list(flags)
    return f"{sum(flags)}/{len(flags)}" if flags else "-"


def _median(values: Iterable[float]) -> float | str:
    values = list(values)
    return median(values) if values else "-"


def costs(scores: Scores) -> Table:
    """Seconds of the stages, and memory."""
    rows: Table = []
    for stage in dict.fromkeys(name for s in scores for name in s.seconds):
        took = [s.seconds[stage] for s in scores if stage in s.seconds]
        rows.append(
            {
                "what": f"{stage} [s]",
                "n": len(took),
                "median": median(took),
                "max": max(took),
            }
        )
    peaks = [s.peak_mb for s in scores if s.peak_mb] or [0.0]
    return [
        *rows,
        {
            "what": "memory [MB]",
            "n": len(scores),
            "median": median(peaks),
            "max": max(peaks),
        },
    ]


def failures(scores: Scores) -> Table:
    """One line for every trial that went wrong, with why the planted effect was rejected."""
    return [
        {
            "trial": s.key,
            "planted": s.label,
            "visible": s.visible,
            "verdict": s.verdict,
            "named": list(s.named),
            "extra": list(s.extra),
            "sizes": [[z.symbol, z.planted, z.value, z.std, z.inside] for z in s.sizes],
            "why": s.why,
        }
        for s in scores
        if not is_good(s)
    ]


def is_good(score: Score) -> bool:
    """Whether a trial ended as it should."""
    if score.kind == "none":
        return not stated(score)
    if score.kind == "outside":
        return not score.confident and score.verdict != "failed"
    missed = bool(score.visible) and not (score.right_or_group or score.by_finding)
    outside = any(size.inside is False for size in score.sizes)
    elsewhere = score.off_s is not None and score.off_s > NEAR_S
    return not (
        missed
        or outside
        or elsewhere
        or score.wrong_name
        or score.extra
        or score.verdict == "failed"
    )


def as_json(scores: Scores) -> str:
    """Tables and failed trials."""
    found = {**tables(scores), "failed trials": failures(scores)}
    return json.dumps(found, indent=1)
