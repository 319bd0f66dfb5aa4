"""What several test modules share: the command line and one completed run; workers."""

import contextlib
import os
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path

import hypothesis
import pytest

from auvident import parallel
from tests import loop_world, seeds, session
from tests.command_line import SAMPLES, Called, call
from tests.finished_run import Finished, finished_run
from tests.long_tests import is_long, unknown

os.environ.pop("COLUMNS", None)  # tables as they are in a pipe, whatever terminal this is
seeds.move_all()
# A worker that begins one of these at the end lets the others wait.
FIRST = ("test_kvlcc2.py", "test_vertical_diagnosis.py", "test_readme.py")
# no test fails because the machine is busy
hypothesis.settings.register_profile("unhurried", deadline=None)
hypothesis.settings.load_profile("unhurried")


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_setupnodes(specs: list[object]) -> None:
    """Before the workers start: kernels compiled once, and as many threads as there is room for."""
    from tests.warm_kernels import warm

    warm()
    room = parallel.threads() // len(specs)
    os.environ.setdefault(parallel.VARIABLE, str(max(1, room)))


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--long", action="store_true", help="run the long tests, and none else")


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """What takes longest comes first, the long tests by themselves; else the order stays."""
    items.sort(key=lambda item: item.path.name not in FIRST)
    if config.option.file_or_dir == [] and (stale := unknown(i.nodeid for i in items)):
        raise pytest.UsageError(f"tests/long_tests.py: no test is called {stale[0]}")
    chosen = [i for i in items if is_long(i.nodeid) == config.option.long]
    config.hook.pytest_deselected(items=[i for i in items if i not in set(chosen)])
    items[:] = chosen


@pytest.fixture(scope="session", autouse=True)
def shared_folder(tmp_path_factory: pytest.TempPathFactory) -> None:
    """Where the workers of this session leave what others need as well (see `session.once`)."""
    if "PYTEST_XDIST_WORKER" in os.environ:
        session.folder = tmp_path_factory.getbasetemp().parent


@pytest.fixture(scope="session", autouse=True)
def one_thread_for_linear_algebra() -> Iterator[None]:
    """As in every stage of the program; with more, a diagnosis takes twice the processor time."""
    with parallel.one_blas_thread():
        yield


@pytest.fixture(scope="session")
def figures_drawn_once() -> Iterator[None]:
    from tests.report import drawings

    with drawings.each_once():
        yield


@pytest.fixture
def auvident(figures_drawn_once: None) -> Callable[..., Called]:
    return call


@pytest.fixture(scope="session")
def common_folder(
    tmp_path_factory: pytest.TempPathFactory,
) -> Callable[[str], contextlib.AbstractContextManager[Path]]:
    """A folder of this name that the workers share; the others wait while one fills it."""

    @contextlib.contextmanager
    def shared(name: str) -> Iterator[Path]:
        folder = (session.folder or tmp_path_factory.getbasetemp()) / name
        with session.locked(folder.with_suffix(".lock")):
            folder.mkdir(exist_ok=True)
            try:
                yield folder
            except BaseException:
                shutil.rmtree(folder)  # half a run is none: the next one fills it anew
                raise

    return shared


@pytest.fixture(scope="session")
def finished(common_folder: Callable[[str], contextlib.AbstractContextManager[Path]]) -> Finished:
    """The first run of the README; of several workers one makes it."""
    with common_folder("completed") as folder:
        return finished_run(folder)


@pytest.fixture(scope="session")
def completed(finished: Finished) -> Path:
    """A folder with ``sample_logs`` and ``runs/demo``, a finished run; not to be written to."""
    assert finished.called.code == 0, finished.called.err
    return finished.folder


@pytest.fixture
def demo(completed: Path, tmp_path: Path) -> Iterator[Path]:
    """A copy of the finished run to work on, as ``runs/demo`` of the current folder."""
    (tmp_path / "sample_logs").symlink_to(SAMPLES)
    shutil.copytree(completed / "runs", tmp_path / "runs")
    with contextlib.chdir(tmp_path):
        yield Path("runs/demo")


@pytest.fixture
def quick_loop(monkeypatch: pytest.MonkeyPatch) -> loop_world.HandMade:
    """`diagnose` and `refine` by hand-made stages that find nothing, for tests of the others."""
    return loop_world.put_in_place(monkeypatch, loop_world.nothing)


@pytest.fixture
def quick_report(monkeypatch: pytest.MonkeyPatch) -> None:
    """`report` by a page that says nothing, for tests that do not look at it."""
    page = {"report/report.html": "<!DOCTYPE html><title>nothing</title>"}
    loop_world.replace_stage(monkeypatch, "report", lambda given: page)
