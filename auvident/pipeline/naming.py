"""Files in the quality report: named so that it does not matter how their path was typed."""

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from auvident.schema.logs import Quality

NAMING = ("file", "where")  # keys under which a file stands


def not_here(path: Path) -> Path:
    """A path that says its name; the current folder is one that does not."""
    return Path("..") / Path.cwd().name if path == Path() else path


def named_alike(quality: Quality, logs: Sequence[Path]) -> Quality:
    """The report with files by the folder of their trial and their own name.

    Parameters
    ----------
    quality : Quality
    logs : sequence of Path
        As they were given: relative or absolute, through a link or not.
    """
    given = list(map(Path, logs))
    short = dict(zip((str(not_here(path)) for path in given), _short(given), strict=True))
    tree = _renamed(quality.model_dump(by_alias=True), short)
    return Quality.model_validate(tree)


def _short(paths: Sequence[Path]) -> list[str]:
    """The names of folders, and of files with their folder; with more above where two are alike."""
    wholes = [p.resolve() if p.is_dir() else p.parent.resolve() / p.name for p in paths]
    for above in range(1, max((len(whole.parts) for whole in wholes), default=0) + 1):
        named = [_end(whole, above + (not whole.is_dir())) for whole in wholes]
        if len(set(named)) == len(set(wholes)):
            return named
    return list(map(str, wholes))


def _end(path: Path, parts: int) -> str:
    return Path(*path.parts[-parts:]).as_posix()


def _renamed(tree: Any, short: dict[str, str], key: str = "") -> Any:
    if isinstance(tree, dict):
        return {k: _renamed(value, short, k) for k, value in tree.items()}
    if isinstance(tree, list | tuple):
        return [_renamed(value, short, key) for value in tree]
    if not isinstance(tree, str) or key not in NAMING:
        return tree
    typed = sorted(short, key=len, reverse=True)
    either = "|".join(rf"(?<![\w./-]){re.escape(text)}(?!\w)" for text in typed)
    return re.sub(either, lambda found: short[found[0]], tree)
