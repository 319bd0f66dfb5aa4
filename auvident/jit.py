"""Compilation of the numerical kernels, cached on disk where that is possible.

Where neither the installation nor the user's cache folder can be written, kernels are compiled
into a temporary folder of this process, and `cache_is_writable` says so.
"""

import os
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

from numba import njit


def _writable(folder: Path) -> bool:
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return True
    except OSError:
        return False


def _candidates() -> list[Path]:
    """Folders numba would try, in its order: beside the source, then the user's cache."""
    named = os.environ.get("NUMBA_CACHE_DIR")
    if named:
        return [Path(named)]
    return [Path(__file__).parent / "__pycache__", Path.home() / ".cache" / "numba"]


def cache_is_writable() -> bool:
    """Whether compiled kernels outlive this process."""
    return any(_writable(folder) for folder in _candidates())


def compiled_already() -> bool:
    """Whether an earlier process left the compiled kernels (so none has to wait for them)."""
    folders = [Path(__file__).parent / "engines" / "__pycache__", *_candidates()[-1:]]
    return any(next(folder.glob("**/compiled._pass-*.nbc"), None) for folder in folders)


if not cache_is_writable():
    import numba.core.config

    numba.core.config.CACHE_DIR = tempfile.mkdtemp(prefix="auvident-kernels-")

kernel: Callable[[Callable[..., Any]], Any] = njit(cache=True)
