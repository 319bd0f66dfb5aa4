"""The cache of compiled kernels never breaks the program, and says what it is."""

import ctypes
import json
import os
import re
import shutil
import subprocess
import sys
import time
from pathlib import Path
from types import SimpleNamespace

import pytest

from auvident import jit
from auvident.jit import KERNEL_MODULES, PACKAGE, compiled_already
from auvident.physics.actuation import turning_points

PR_CAPBSET_DROP, CAP_DAC_OVERRIDE = 24, 1  # Linux
SMALL = """
import sys, json
import numpy as np
sys.path.insert(0, {root!r})
from auvident import jit
from auvident.estimation.kalman import unscented_weights
before = sum(1 for _ in jit._permanent().glob("**/*.nbc")) if jit.cache_is_writable() else -1
unscented_weights(4, 1.0)
stats = unscented_weights.stats
print(json.dumps([jit.cache_is_writable(), jit.compiled_already(), before,
                  sum(stats.cache_hits.values()), str(jit._permanent())]))
"""

BOTH = """
import sys
sys.path.insert(0, {root!r})
import numpy as np
from numba import njit
from auvident.physics.actuation import turning_points
own = turning_points(np.array([0.0, 2.0, 1.0, 3.0, 0.5]))
bare = not {{"numba.np.linalg", "numba.np.arrayobj"}} & set(sys.modules)
same = njit(lambda n: turning_points(np.arange(n)))(4.0)
print("[" + str(int(bare)) + ",", str(int(own.tolist() + same.tolist() == [0, 3, 0.5, 0, 3])) + "]")
"""

AFTER = """
import sys, json
sys.path.insert(0, {root!r})
import numpy as np
from auvident.physics.actuation import _turn_fins, turning_points
turning_points(np.zeros(3))
order, angle = np.linspace(0.0, 0.1, 5), np.empty((1, 5))
_turn_fins(np.zeros(0), order, 0.1, np.zeros((1, 19)), angle)
stats = turning_points.stats.cache_hits, _turn_fins.stats.cache_hits
print(json.dumps([*(sum(hits.values()) for hits in stats), bool(np.allclose(angle, order))]))
"""


@pytest.fixture
def installed(tmp_path: Path) -> Path:
    """A copy of the installed package with nothing compiled."""
    ignored = shutil.ignore_patterns("__pycache__")
    shutil.copytree(PACKAGE, tmp_path / "site" / "auvident", ignore=ignored)
    return tmp_path / "site"


def obey_permissions() -> None:
    """Give up the superuser's right to write anywhere; for others there is nothing to give up."""
    if os.geteuid() == 0:
        ctypes.CDLL(None).prctl(PR_CAPBSET_DROP, CAP_DAC_OVERRIDE, 0, 0, 0)


def run_in(site: Path, home: Path, script: str = SMALL, **environment: str) -> list:
    """Use one kernel in a fresh process."""
    keep = {k: v for k, v in os.environ.items() if k not in ("NUMBA_CACHE_DIR", "XDG_CACHE_HOME")}
    done = subprocess.run(
        [sys.executable, "-c", script.format(root=str(site))],
        env={**keep, "HOME": str(home), "PYTHONDONTWRITEBYTECODE": "1", **environment},
        preexec_fn=obey_permissions,
        capture_output=True,
        text=True,
        cwd=site,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def close(folder: Path) -> None:
    """Nobody may write here."""
    for path in (folder, *folder.rglob("*")):
        path.chmod(0o555 if path.is_dir() else 0o444)


def open_again(folder: Path) -> None:
    for path in (folder, *folder.rglob("*")):
        path.chmod(0o755 if path.is_dir() else 0o644)


def test_a_read_only_installation_is_cached_for_the_user(installed: Path, tmp_path: Path) -> None:
    home = tmp_path / "home"
    home.mkdir()
    close(installed)
    try:
        first = run_in(installed, home)
        second = run_in(installed, home)
    finally:
        open_again(installed)
    assert first[:4] == [True, False, 0, 0]
    assert first[4].startswith(str(home))
    assert second[2] == 1 and second[3] == 1  # found, and loaded instead of compiled


def test_an_installation_is_never_written_to(installed: Path, tmp_path: Path) -> None:
    """Not even one that can be: what is compiled is of its user, and goes where XDG says."""
    found = run_in(installed, tmp_path / "home", XDG_CACHE_HOME=str(tmp_path / "cache"))
    assert found[0] and found[4].startswith(str(tmp_path / "cache" / "auvident"))
    assert not list(installed.rglob("*.nbc"))


def test_a_checkout_keeps_its_own(installed: Path, tmp_path: Path) -> None:
    (installed / "pyproject.toml").touch()
    found = run_in(installed, tmp_path / "home")
    assert found[0] and found[4].startswith(str(installed / "auvident" / "__pycache__"))


@pytest.mark.skipif(not hasattr(os, "geteuid"), reason="users have no numbers here")
def test_what_another_user_compiled_is_not_loaded(tmp_path: Path, monkeypatch) -> None:
    assert jit._usable(tmp_path)
    monkeypatch.setattr(os, "geteuid", lambda: tmp_path.stat().st_uid + 1)
    assert not jit._usable(tmp_path)


def test_nothing_writable_still_works_and_says_so(installed: Path, tmp_path: Path) -> None:
    home = tmp_path / "home"
    home.mkdir()
    close(home)
    close(installed)
    try:
        assert run_in(installed, home)[:3] == [False, False, -1]
    finally:
        open_again(installed)
        home.chmod(0o755)


def test_a_named_folder_is_used(installed: Path, tmp_path: Path) -> None:
    named = tmp_path / "named"
    named.mkdir()
    found = run_in(installed, tmp_path, NUMBA_CACHE_DIR=str(named))
    assert found[0] and found[4].startswith(str(named))


def test_what_is_compiled_is_loaded_alone_and_can_be_compiled_with(
    installed: Path, tmp_path: Path
) -> None:
    """What numba imports to compile is not needed to load, and comes when something compiles."""
    assert run_in(installed, tmp_path, BOTH)[1] == 1
    assert run_in(installed, tmp_path, BOTH) == [1, 1]
    assert run_in(installed, tmp_path, AFTER) == [1, 0, True]
    assert run_in(installed, tmp_path, AFTER) == [1, 1, True]


def test_changed_sources_are_compiled_anew(installed: Path, tmp_path: Path) -> None:
    """numba looks only at the file of the function itself, not at those of what it calls."""
    named = tmp_path / "named"
    named.mkdir()
    first = run_in(installed, tmp_path, NUMBA_CACHE_DIR=str(named))
    with (installed / "auvident/physics/batch.py").open("a") as source:
        source.write("# changed\n")
    second = run_in(installed, tmp_path, NUMBA_CACHE_DIR=str(named))
    assert first[4] != second[4] and second[3] == 0


def test_what_nobody_used_for_a_month_is_removed(tmp_path: Path, monkeypatch) -> None:
    own, recent, old = (tmp_path / f"{jit.FOLDER}{name}" for name in ("own", "recent", "old"))
    other = tmp_path / "something-else"
    for folder in (own, recent, old, other):
        folder.mkdir()
        (folder / "kernel.nbc").touch()
    for folder in (own, old, other):
        os.utime(folder, (0.0, time.time() - 1.01 * jit.UNUSED_S))
    os.utime(recent, (0.0, time.time() - 0.99 * jit.UNUSED_S))
    monkeypatch.setattr(jit, "_permanent", lambda: own)
    jit.remove_unused()
    assert sorted(tmp_path.iterdir()) == sorted([own, recent, other])
    monkeypatch.setattr(jit, "_permanent", lambda: None)
    jit.remove_unused()


def test_a_folder_in_use_is_dated(installed: Path, tmp_path: Path) -> None:
    named = tmp_path / "named"
    named.mkdir()
    place = Path(run_in(installed, tmp_path, NUMBA_CACHE_DIR=str(named))[4])
    os.utime(place, (0.0, 0.0))
    (tmp_path / "before").touch()
    run_in(installed, tmp_path, NUMBA_CACHE_DIR=str(named))
    assert place.stat().st_mtime >= (tmp_path / "before").stat().st_mtime


def test_compiled_already_looks_for_the_passes(installed: Path, tmp_path: Path) -> None:
    named = tmp_path / "named"
    named.mkdir()
    place = Path(run_in(installed, tmp_path, NUMBA_CACHE_DIR=str(named))[4])
    (place / "engines_0").mkdir()
    (place / "engines_0" / "passes.ekf_pass-1.py311.1.nbc").touch()
    assert run_in(installed, tmp_path, NUMBA_CACHE_DIR=str(named))[1]
    assert isinstance(compiled_already("ukf"), bool)


def test_every_kernel_module_is_in_the_name_of_the_cache() -> None:
    users = {
        str(path.relative_to(PACKAGE))
        for path in PACKAGE.rglob("*.py")
        if re.search(r"^@(kernel|borrowing|loop|inlined|written)$", path.read_text(), re.MULTILINE)
    }
    users |= {  # whose equations a neighbour compiles
        str((path.parent / f"{module}.py").relative_to(PACKAGE))
        for path in PACKAGE.rglob("*.py")
        for module in re.findall(r"= kernel\((\w+)\.\w+\)$", path.read_text(), re.MULTILINE)
    }
    assert users == set(KERNEL_MODULES)


def test_where_numba_has_renamed_what_the_cache_rests_on_numba_loads(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    asked = []
    monkeypatch.setattr(jit, "OF_NUMBA", (*jit.OF_NUMBA, "renamed"))
    monkeypatch.setattr(jit.FunctionCache, "load_overload", lambda *by: asked.append(by[1:]))
    cache = object.__new__(jit._Kept)
    assert cache.load_overload("signature", "target") is None
    assert asked == [("signature", "target")]


@pytest.mark.parametrize("renamed", ["", "OF_ITS_FILES", "OF_ENVIRONMENTS"])
def test_where_numba_has_renamed_how_it_reads_it_reads_by_itself(
    renamed: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    if renamed:
        monkeypatch.setattr(jit, renamed, (*getattr(jit, renamed), "renamed"))
    monkeypatch.setattr(jit._Kept, "_load_overload", lambda *by: by[1])
    files = SimpleNamespace(_data_path=str, _load_data=str)
    cache = object.__new__(jit._Kept)
    cache._cache_file = files
    assert cache.load_overload("signature", turning_points.targetctx) == "signature"
    assert (files._load_data is str) == bool(renamed)
