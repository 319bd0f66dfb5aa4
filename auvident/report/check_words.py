"""What the checks of a log say first: what contradicts, and what nothing tests."""

from collections.abc import Sequence

from auvident.schema.logs import CheckMade, TrialQuality

MOST_TRIALS = 3  # named in one line


def contradictions(trials: Sequence[TrialQuality]) -> list[str]:
    """One sentence for each contradiction, with its fix and, of several trials, its trials."""
    found: dict[str, list[tuple[CheckMade, str]]] = {}
    for trial in trials:
        for made in trial.checks_made:
            if made.outcome == "contradicts":
                found.setdefault(made.name, []).append((made, trial.trial))
    return [_sentence(rows, len(trials)) for rows in found.values()]


def _sentence(rows: list[tuple[CheckMade, str]], trials: int) -> str:
    made = rows[0][0]
    ending = "" if made.message.endswith("?") else "."
    text = f"{made.what[:1].upper()}{made.what[1:]} contradicted: {made.message}{ending}"
    if trials > 1:
        names = ", ".join(name for _, name in rows[:MOST_TRIALS])
        more = f" and {len(rows) - MOST_TRIALS} more" if len(rows) > MOST_TRIALS else ""
        text += f" In {names}{more}."
    return text + (f" Fix: --fix {made.name}." if made.fix else "")


def untested(trials: Sequence[TrialQuality]) -> str:
    """What no check of any trial could test, with the reasons, and what was tested coarsely.

    Empty where all was tested.
    """
    groups: dict[str, list[str]] = {}
    for what, why in left_open(trials).items():
        groups.setdefault(why, []).append(what)
    left = [f"{_listed(names)} ({why})" for why, names in groups.items()]
    coarsely = [f"{what} ({only})" for what, only in coarse(trials).items()]
    texts = {"Not tested": left, "Tested only coarsely": coarsely}
    return " ".join(f"{words}: {', '.join(rows)}." for words, rows in texts.items() if rows)


def coarse(trials: Sequence[TrialQuality]) -> dict[str, str]:
    """Every quantity that was tested, but by no trial more than coarsely, and how coarsely."""
    made = [c for t in trials for c in t.checks_made if c.outcome != "untested"]
    fine = {c.what for c in made if not c.only}
    return {c.what: c.only for c in made if c.only and c.what not in fine}


def left_open(trials: Sequence[TrialQuality]) -> dict[str, str]:
    """Every quantity that no check of any trial could test, with the reasons."""
    tested: set[str] = set()
    reasons: dict[str, list[str]] = {}
    for trial in trials:
        for made in trial.checks_made:
            if made.outcome != "untested":
                tested.add(made.what)
            elif made.message not in reasons.setdefault(made.what, []):
                reasons[made.what].append(made.message)
    return {what: "; ".join(why) for what, why in reasons.items() if what not in tested}


def _listed(names: list[str]) -> str:
    return " and ".join([", ".join(names[:-1]), names[-1]] if names[1:] else names)
