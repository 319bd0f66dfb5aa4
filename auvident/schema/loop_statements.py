"""Verdicts of the residual loop in sentences, the same after `diagnose` and after `refine`."""

from collections.abc import Mapping, Sequence
from typing import Any

from auvident.schema.artifacts import Verdict
from auvident.schema.diagnosis import Detectable, EffectFound

NAMED_SIZES = 6  # sizes told in the statement that nothing was found


def statement(
    verdict: Verdict,
    effects: Sequence[EffectFound],
    groups: Sequence[Sequence[str]],
    separate_by: str,
    sees: Sequence[Detectable],
    unexplained: Mapping[str, Any],
) -> str:
    """The verdict in words.

    Parameters
    ----------
    verdict : str
    effects : sequence of EffectFound
        Those that stand.
    groups : sequence of sequence of str
        Effects that cannot be told apart.
    separate_by : str
        What would tell them apart.
    sees : sequence of Detectable
    unexplained : mapping
        As in the artifacts: ``correlates``, ``nearest``, ``channels``.
    """
    pieces = {
        "none_found": lambda: [nothing_found(sees)],
        "effect_found": lambda: [found(effects)],
        "ambiguous": lambda: [found(effects), alike(groups, separate_by)],
        "partly_explained": lambda: [
            found(effects),
            alike(groups, separate_by),
            remaining(unexplained),
        ],
        "unexplained": lambda: [nothing_known(unexplained)],
    }[verdict]()
    return " ".join(piece for piece in pieces if piece)


def remaining_of(verdict: Verdict, unexplained: Mapping[str, Any]) -> dict[str, Any]:
    """What ``remaining`` says beside effects that stand; empty for the other verdicts."""
    if verdict != "partly_explained":
        return {}
    return {key: unexplained.get(key) or [] for key in ("channels", "correlates")}


def nothing_found(sees: Sequence[Detectable]) -> str:
    """The statement that nothing is missing, with what would have been seen."""
    shown = [row for row in sees if row.visible][:NAMED_SIZES]
    listed = ", ".join(f"{row.id} {row.symbol} {row.size:.2g} {row.unit}" for row in shown)
    return f"Nothing is missing that these maneuvers would show. Seen would have been: {listed}."


def found(effects: Sequence[EffectFound]) -> str:
    """The statement of what was found."""
    return f"The model lacks {' and '.join(e.plain or e.id for e in effects)}."


def alike(groups: Sequence[Sequence[str]], separate_by: str) -> str:
    """What explains the data alike, and what would tell it apart; empty where nothing does."""
    if not groups:
        return ""
    listed = "; ".join(" or ".join(group) for group in groups)
    return f"These data cannot tell apart: {listed}. To separate them: {separate_by}."


def remaining(unexplained: Mapping[str, Any]) -> str:
    """The statement that something is left beside what was found."""
    text = f"Something remains{_where(unexplained)}"
    if unexplained.get("nearest"):
        text += f"; a free force does better than {unexplained['nearest']}"
    return text + "."


def nothing_known(unexplained: Mapping[str, Any]) -> str:
    """The statement that something is there which no effect explains."""
    text = f"Something is there that no known effect explains{_where(unexplained)}"
    if unexplained.get("nearest"):
        text += f"; the nearest of the known effects, not confirmed, is {unexplained['nearest']}"
    return text + "."


def _where(unexplained: Mapping[str, Any]) -> str:
    """Channels in which something is left, and what it follows."""
    channels, text = unexplained.get("channels"), ""
    if channels:
        text += f" (in {', '.join(channels)})"
    if unexplained.get("correlates"):
        best = unexplained["correlates"][0]
        text += f"; it goes with {best['regressor']} on {best['axis']}"
    return text


def not_added(effects: Sequence[str], ratios: Mapping[str, float], ran_away: bool) -> str:
    """The statement that a model with what was found is no better, so that nothing was added."""
    worse = ", ".join(f"{c} {100.0 * (ratio - 1.0):+.0f} %" for c, ratio in ratios.items())
    why = "leaves every bound in them" if ran_away else f"has errors of {worse} in them"
    return (
        f"Nothing could be added that predicts the maneuvers that identify better: a model with "
        f"{' and '.join(effects)} {why}. The model stays as it was."
    )


def not_confirmed(effects: Sequence[EffectFound]) -> str:
    """What a model predicts with although its size is not told from zero; empty for nothing."""
    if not effects:
        return ""
    listed = " and ".join(e.plain or e.id for e in effects)
    return (
        f"Not confirmed, as the interval of its size holds zero, and used for prediction: {listed}."
    )
