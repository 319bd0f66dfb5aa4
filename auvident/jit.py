"""Compilation of the numerical kernels, cached on disk where that is possible.

The cache lies in the checkout that the package is used from, else in the user's cache folder, else
(neither can be written) in a temporary folder of this process, and `cache_is_writable` says so. It
is never one that belongs to another user: what is loaded from there is run. Its folder is named
after numba and the sources of all kernels together: numba itself looks only at the file of a
function, and would go on using what was compiled with an older version of the functions it calls.
"""

import atexit
import hashlib
import os
import pickle
import shutil
import tempfile
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any

from numba import __version__ as numba_version
from numba import njit
from numba.core import config, environment
from numba.core.caching import FunctionCache
from numba.core.compiler import Compiler
from numba.core.registry import cpu_target
from numba.core.runtime import rtsys
from numba.extending import intrinsic
from platformdirs import user_cache_path

from auvident.parallel import beside

PACKAGE = Path(__file__).resolve().parent
KERNEL_MODULES = (
    "engines/accumulated.py",
    "engines/motion_pass.py",
    "engines/passes.py",
    "engines/sigma_points.py",
    "estimation/coloured.py",
    "estimation/kalman.py",
    "physics/actuation.py",
    "physics/batch.py",
    "physics/dynamics.py",
    "physics/fleet.py",
    "physics/readings.py",
    "physics/rows.py",
    "physics/sensing.py",
    "physics/sensitivity.py",
    "physics/six_dof.py",
    "physics/term_tables.py",
)
# Without a wrapper that lets C call a kernel: nobody does, and it took a twentieth of compiling.
ALWAYS: Any = {"error_model": "numpy", "nogil": True, "no_cfunc_wrapper": True}
FOLDER = "auvident-kernels-"
UNUSED_S = 30 * 86400.0  # a folder that no process used for a month belongs to a version long gone


def _usable(folder: Path) -> bool:
    """Whether a folder is ours, and can be written."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if hasattr(os, "geteuid") and folder.stat().st_uid != os.geteuid():
            return False
        with tempfile.TemporaryFile(dir=folder):
            return True
    except OSError:
        return False


def _candidates() -> list[Path]:
    """Folders the cache may lie in: the one the user names, else the checkout's, the user's."""
    sources = hashlib.sha256(numba_version.encode())
    for module in ("jit.py", *KERNEL_MODULES):  # how they are compiled counts as well
        sources.update((PACKAGE / module).read_bytes())
    name = FOLDER + sources.hexdigest()[:16]
    named = os.environ.get("NUMBA_CACHE_DIR")
    if named:
        return [Path(named) / name]
    checkout = [PACKAGE / "__pycache__"] if (PACKAGE.parent / "pyproject.toml").exists() else []
    return [folder / name for folder in (*checkout, user_cache_path("auvident", appauthor=False))]


@cache
def _permanent() -> Path | None:
    """The first folder that can be used; its date says when it was used last."""
    folder = next((folder for folder in _candidates() if _usable(folder)), None)
    if folder is not None:
        with suppress(OSError):  # another user's, whose date is not ours to change
            os.utime(folder)
    return folder


def remove_unused() -> None:
    """Remove what other versions left beside our own folder and nobody uses any more."""
    folder = _permanent()
    if folder is None:
        return
    for other in folder.parent.glob(f"{FOLDER}*"):
        with suppress(OSError):  # someone else was faster
            if other != folder and time.time() - other.stat().st_mtime > UNUSED_S:
                shutil.rmtree(other, ignore_errors=True)


@cache
def _temporary() -> Path:
    folder = Path(tempfile.mkdtemp(prefix=FOLDER))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return folder


def cache_folder() -> Path | None:
    """Where compiled kernels are kept; None where they do not outlive this process."""
    return _permanent()


def cache_is_writable() -> bool:
    """Whether compiled kernels outlive this process."""
    return _permanent() is not None


def compiled_already(kind: str = "ekf") -> bool:
    """Whether an earlier process left the kernels of a filter (so nobody has to wait for them)."""
    return has_compiled(f"passes.{kind}_pass")


def has_compiled(name: str) -> bool:
    """Whether an earlier process left a kernel, named with its module: ``fleet._step``."""
    folder = _permanent()
    return folder is not None and any(folder.glob(f"*/{name}-*.nbc"))


OF_NUMBA = ("_load_overload", "_guard_against_spurious_io_errors", "_cache_file")
OF_ITS_FILES = ("_data_path", "_load_data")
OF_ENVIRONMENTS = ("Environment", "_rebuild_env", "lookup_environment")


class _Kept(FunctionCache):  # type: ignore[misc]
    """numba's cache, which loads what is compiled without all that only compiling needs.

    numba first imports 216 modules, scipy.linalg among them, which hold the types and functions
    that a kernel may use: a fifth of a second. One that is compiled uses symbols of the
    mathematics and the memory of arrays; what is to be compiled imports the rest by itself.

    It rests on names that numba promises nobody (`OF_NUMBA` and those below it): without them
    numba loads.
    """

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """The compiled function for a signature; None when there is none."""
        if not _has(self, OF_NUMBA):
            return super().load_overload(sig, target_context)
        files = self._cache_file
        if _has(files, OF_ITS_FILES) and _has(environment, OF_ENVIRONMENTS):
            vars(files)["_load_data"] = lambda name: _loaded(Path(files._data_path(name)))
        rtsys.initialize(target_context)
        with self._guard_against_spurious_io_errors():
            return self._load_overload(sig, target_context)


def _has(owner: object, names: Sequence[str]) -> bool:
    return all(hasattr(owner, name) for name in names)


def _loaded(file: Path) -> Any:
    """What numba has kept in a file."""
    with file.open("rb") as content:
        return _Reader(content).load()


class _Reader(pickle.Unpickler):
    """Reads a kernel without the modules of the functions of numba that it is made of.

    Each function has an environment, with the globals of its module for what is not compiled and
    constants for that which is. Those of numba are compiled whole.
    """

    def find_class(self, module: str, name: str) -> Any:
        """As pickle finds it, but for what makes an environment."""
        if (module, name) == (environment.__name__, "_rebuild_env"):
            return _environment
        return super().find_class(module, name)


def _environment(module: str, constants: list[Any], name: str) -> Any:
    """The environment of a function in a kernel."""
    if constants or not module.startswith("numba."):
        return environment._rebuild_env(module, constants, name)
    found = environment.lookup_environment(name)
    if found is None:
        found = environment.Environment({"__name__": module})
        found.env_name = name
        environment.Environment._memo[name] = found
    return found


def begin_beside() -> None:
    """Begin in another thread what loading the first kernel would wait for."""
    beside(lambda: rtsys.initialize(cpu_target.target_context))


def _compiled_in(folder: Path, function: Callable[..., Any], **options: Any) -> Any:
    """Compile with the cache in a folder; numba's setting is put back for everyone else."""
    before = config.CACHE_DIR  # type: ignore[attr-defined]
    config.CACHE_DIR = str(folder)  # type: ignore[attr-defined]
    try:
        compiled = njit(**ALWAYS, **options)(function)
        compiled._cache = _Kept(function)
        return compiled
    finally:
        config.CACHE_DIR = before  # type: ignore[attr-defined]


def kernel(function: Callable[..., Any], **options: Any) -> Any:
    """Compile a function when it is first called; division by zero gives infinity, as in numpy.

    It runs without the interpreter's lock, so that others run beside it (see `parallel`).
    """
    try:
        return _compiled_in(_permanent() or _temporary(), function, **options)
    except RuntimeError:  # numba: "no locator available": a folder inside belongs to someone else
        return _compiled_in(_temporary(), function, **options)


class _Apart(Compiler):
    """numba's compiler, told that no two arrays among the arguments overlap."""

    def define_pipelines(self) -> Any:
        """Set the flag, which `njit` has no option for."""
        self.state.flags.noalias = True
        return super().define_pipelines()


def loop(function: Callable[..., Any]) -> Any:
    """Compile a kernel that Python calls and that only works in arrays of its caller.

    See `borrowing` for where it may be used. An array that it writes to must not overlap another:
    without that promise every short loop over two arrays would first compare where they lie.
    """
    return kernel(function, _nrt=False, pipeline_class=_Apart)


def inlined(function: Callable[..., Any]) -> Any:
    """Put a part of a kernel in place of its calls before it is compiled.

    For the large parts of a loop: every function is optimized with all that it calls, and a level
    more between the loop and its innermost kernels took a quarter longer to compile.
    """
    return njit(inline="always")(function)


def borrowing(function: Callable[..., Any]) -> Any:
    """Compile a kernel that only works in arrays of its caller, in place of its calls.

    numba counts the references to every array on the way into a function and out of it, and hands
    each over as seven numbers. In the innermost kernels, which take a dozen arrays, that costs
    more than the arithmetic: they do not count, and are put in place of their calls.

    It may be used where every array is the caller's: views of them and numbers may be made, but
    no array, and none may be returned or kept, not even a view: nothing would hold its memory.
    What it writes to must not overlap another argument (`loop`).
    """
    return kernel(function, _nrt=False, forceinline=True, pipeline_class=_Apart)


# A part of a kernel whose instructions are written down, in place of its calls; for what no loop is
# compiled to. Its types know nothing of the first argument, which numba adds.
written: Any = intrinsic
