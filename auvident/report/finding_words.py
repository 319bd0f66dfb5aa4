"""How a finding is told beside its message: the evidence, where the message has no number of it."""

from auvident.schema.artifacts import Finding

# codes whose value means nothing beside the sentence (a share of information, a ratio of errors)
SAID = frozenset(
    {
        "not-seen",
        "rests-on-prior",
        "worse-than-prior",
        "worse-refined",
        "error-rises",
        "channels_absent",
        "stability_undecided",
        "sensor_shifted",
    }
)
IN_THE_MESSAGE = frozenset({"prior-contradicted"})  # of which the limit alone is told
# what the value of a code is, where the message does not say
QUANTITY = {
    "priors-contradicted": "probability",
    "maneuvers-disagree": "scatter over that of the fit",
    "fin_in_wake": "share of the span",
    "few-trials": "trials",
    "no-better": "ratio of squared errors",
    "hardly-keeps-course": "growth over a hull length",
}


def evidence(finding: Finding) -> str:
    """``(value 2.52, limit 2)``; empty where there is none, or the message says it."""
    if finding.value is None or finding.code in SAID:
        return ""
    limit = "" if finding.threshold is None else f"limit {finding.threshold:.3g}"
    if finding.code in IN_THE_MESSAGE:
        return f" ({limit})" if limit else ""
    value = f"{QUANTITY.get(finding.code, 'value')} {finding.value:.3g}"
    return f" ({value}, {limit})" if limit else f" ({value})"
