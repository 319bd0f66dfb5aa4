"""Programs from templates: lines that only some models need, places for what is theirs.

A line that begins with ``[a b]`` stands where a model has the feature a or b, one with ``[!a]``
where it lacks it; ``@name@`` is replaced once, so that no text put in is read as a place.
"""

import re
from collections.abc import Collection, Iterable, Mapping

MARK = re.compile(r"\[([!\w ]+)\]")
PLACE = re.compile(r"@(\w+)@")


def assembled(parts: Iterable[tuple[str, str]], features: Collection[str]) -> str:
    """Those parts of a template whose feature a model has, or that every model needs."""
    return "".join(part for feature, part in parts if not feature or feature in features)


def filled(template: str, features: Collection[str], values: Mapping[str, str]) -> str:
    """The template for a model with these features and values."""
    lines = []
    for line in template.splitlines():
        mark = MARK.match(line)
        if mark is None:
            lines.append(line)
        elif any(_holds(condition, features) for condition in mark[1].split()):
            lines.append(line[mark.end() :])
    return PLACE.sub(lambda place: values[place[1]], "\n".join(lines)) + "\n"


def _holds(condition: str, features: Collection[str]) -> bool:
    return condition[1:] not in features if condition.startswith("!") else condition in features
