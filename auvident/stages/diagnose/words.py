"""Verdicts of a diagnosis in sentences."""

from collections.abc import Sequence

from auvident.schema.diagnosis import Detectable, EffectFound

NAMED_SIZES = 6  # sizes told in the statement that nothing was found


def nothing_found(sees: Sequence[Detectable]) -> str:
    """The statement that nothing is missing, with what would have been seen."""
    shown = [row for row in sees if row.visible][:NAMED_SIZES]
    listed = ", ".join(f"{row.id} {row.symbol} {row.size:.2g} {row.unit}" for row in shown)
    return f"Nothing is missing that these maneuvers would show. Seen would have been: {listed}."


def found(effects: Sequence[EffectFound]) -> str:
    """The statement of what was found."""
    return f"The model lacks {' and '.join(e.plain or e.id for e in effects)}."


def ambiguous(effects: Sequence[EffectFound], groups: Sequence[Sequence[str]], by: str) -> str:
    """The statement that several effects explain the data alike."""
    alike = "; ".join(" or ".join(group) for group in groups)
    return f"{found(effects)} These data cannot tell apart: {alike}. To separate them: {by}."


def unexplained(correlates: Sequence[dict], nearest: str | None, channels: Sequence[str]) -> str:
    """The statement that something is there which no effect explains."""
    text = "Something is there that no known effect explains"
    if channels:
        text += f" (in {', '.join(channels)})"
    if correlates:
        best = correlates[0]
        text += f"; it goes with {best['regressor']} on {best['axis']}"
    if nearest:
        text += f"; the nearest of the known effects is {nearest}, which a free force beats"
    return text + "."
