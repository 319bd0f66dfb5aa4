"""What became of the trials of a run, in words."""

from auvident.schema.logs import Quality

MOST_NAMED = 12  # trials that are set aside, each on a line


def set_aside(quality: Quality) -> list[str]:
    """How many trials were set aside, then each with its reason; empty when none was."""
    aside = quality.set_aside
    if not aside:
        return []
    lines = [f"Set aside: {len(aside)} of {len(aside) + len(quality.trials)} trials"]
    lines += [f"  {a.trial}: {a.reason}" for a in aside[:MOST_NAMED]]
    more = len(aside) - MOST_NAMED
    return [*lines, f"  and {more} more, in ingest/quality.json"] if more > 0 else lines
