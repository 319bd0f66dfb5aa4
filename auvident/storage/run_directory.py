"""The run directory: artifacts by stage, the manifest, and a lock while a stage writes."""

import os
import shlex
import stat
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

from auvident.errors import InputError, StageError, UsageError
from auvident.schema.manifest import Manifest, can_be_output
from auvident.storage.artifacts import (
    TEMPORARY_SUFFIX,
    json_bytes,
    read_model,
    sha256_of,
    write_bytes,
)
from auvident.storage.lock import LOCK_FILE, in_use, locked, worker

MANIFEST = "run.json"
PACKAGE = "package:"  # path of a file that comes with the program
NAMED_RUNS = 5  # of a folder that was given in place of one of them
PACKAGE_ROOT = Path(__file__).resolve().parents[1]
EXPECTED = {"schema_": "auvident/run/1", "program": "auvident"}
NOT_OURS = "It was not written by this program; use another run directory."
REBUILD = (
    "Use another run directory, or remove this one: `auvident run LOG... --vehicle V.toml "
    "--run RUN` makes everything again."
)


def _is_no_folder(path: Path) -> bool:
    """Whether something else is there; asked once, as another process may make or remove it."""
    try:
        return not stat.S_ISDIR(path.stat().st_mode)
    except OSError:  # nothing there; what cannot be looked at is refused when it is locked
        return False


class RunDirectory:
    """A run directory on disk.

    Parameters
    ----------
    path : Path
        It need not exist; the `lock` makes it.
    """

    def __init__(self, path: Path) -> None:
        self.path = Path(path)
        if _is_no_folder(self.path):
            above = next((p for p in self.path.parents if (p / MANIFEST).is_file()), None)
            instead = f"Give the run directory, {above}." if above else "Choose another folder."
            raise UsageError("is a file, not a run directory", str(path), instead)

    def __truediv__(self, relative: str) -> Path:
        return self.path / relative

    def manifest(self) -> Manifest | None:
        """The manifest, or None when there is none yet.

        Raises
        ------
        StageError
            It is damaged, or of a later version of the program, or claims files that no stage
            can have written.
        """
        place = self.path / MANIFEST
        if not place.exists():
            return None
        manifest = read_model(place, Manifest, REBUILD)
        for key, wanted in EXPECTED.items():
            if (found := getattr(manifest, key)) != wanted:
                name = key.rstrip("_")
                raise StageError(f"{name} is {found!r}, not {wanted!r}", str(place), NOT_OURS)
        for stage, name in manifest.strays():
            raise StageError(
                f"stage {stage} cannot have written {name!r}",
                str(place),
                "The manifest was edited; correct it, or use another run directory.",
            )
        return manifest

    @contextmanager
    def lock(self) -> Iterator[None]:
        """Keep other processes out, from before anything is read; see `locked`.

        Raises
        ------
        InUseError
            Another process has it.
        """
        with locked(self.path):
            self._remove_partial_files()
            yield

    def _remove_partial_files(self) -> None:
        """Leftovers of a killed process; only with the lock, else they may be alive."""
        for folder in ("", "*/", "*/*/"):
            pattern = f"{folder}.*{TEMPORARY_SUFFIX}"
            for leftover in self.path.glob(pattern):
                name = leftover.relative_to(self.path).as_posix()
                if leftover.is_file() and self.link_on_the_way(name) is None:
                    leftover.unlink(missing_ok=True)

    def link_on_the_way(self, relative: str) -> Path | None:
        """The first symbolic link from the run directory to a file in it; None without one.

        The run directory itself may be one: that is the place which the user named.
        """
        place = self.path
        for part in Path(relative).parts:
            place = place / part
            if place.is_symlink():
                return place
        return None

    def refuse_link(self, relative: str) -> None:
        """Refuse to write or delete through a symbolic link.

        Raises
        ------
        UsageError
        """
        link = self.link_on_the_way(relative)
        if link is not None:
            raise UsageError(
                "is a symbolic link, and nothing is written or deleted through one",
                str(link),
                "Remove the link, or use another run directory.",
            )

    def refuse_foreign(self, stage: str, names: Collection[str], own: Collection[str]) -> None:
        """Refuse outputs of a stage where something stands that the program has not written.

        Parameters
        ----------
        stage : str
        names : collection of str
            The outputs.
        own : collection of str
            Files that the stage has written before.

        Raises
        ------
        InputError
            A name is none that an artifact can have.
        UsageError
            A file is in the way, or a link.
        """
        self._refuse_no_folder(stage)
        for name in names:
            if not can_be_output(stage, name):
                raise InputError(
                    f"{name!r} cannot be the name of an artifact",
                    str(self.path / name),
                    "Rename the log file or folder that it is named after.",
                )
            self._refuse_no_folder(Path(name).parent.as_posix())
            self.refuse_link(name)
            if name not in own and (self.path / name).exists():
                raise _in_the_way(self.path / name)

    def _refuse_no_folder(self, relative: str) -> None:
        """Refuse a link or a file where a folder of outputs is to be."""
        self.refuse_link(relative)
        place = self.path / relative
        if place.exists() and not place.is_dir():
            raise _in_the_way(place)

    def commit(self, outputs: Mapping[str, bytes], obsolete: frozenset[str] = frozenset()) -> None:
        """Write the outputs of a stage and remove those that it no longer has.

        The manifest follows by `save`: a process killed in between leaves outputs that do not
        fit the manifest, so the stage counts as stale and runs again.
        """
        for relative in outputs.keys() | obsolete:
            self.refuse_link(relative)
        try:
            for relative, content in outputs.items():
                write_bytes(self.path / relative, content)
            for relative in obsolete - outputs.keys():
                (self.path / relative).unlink(missing_ok=True)
                self._remove_empty(Path(relative).parent)
        except OSError as error:
            raise self._cannot_write(error) from None

    def _remove_empty(self, folder: Path) -> None:
        """The folder of a plane that a stage no longer has; that of the stage stays."""
        place = self.path / folder
        if len(folder.parts) > 1 and place.is_dir() and not any(place.iterdir()):
            place.rmdir()

    def save(self, manifest: Manifest) -> None:
        """Replace the manifest."""
        self.refuse_link(MANIFEST)
        try:
            write_bytes(self.path / MANIFEST, json_bytes(manifest, MANIFEST))
        except OSError as error:
            raise self._cannot_write(error) from None

    def _cannot_write(self, error: OSError) -> InputError:
        place = error.filename or str(self.path)
        return InputError(
            f"cannot be written: {error.strerror}", str(place), "Check disk space and permissions."
        )

    def sha256(self, relative: str) -> str | None:
        """Hash of an artifact; None when it is missing, or stands behind a link elsewhere."""
        return None if self.link_on_the_way(relative) else sha256_of(self.path / relative)

    def remembered(self, path: Path) -> str:
        """A path outside of the run directory as the manifest keeps it.

        Relative, so that a project can be moved as a whole; absolute where the two share
        nothing but the root.
        """
        whole = Path(os.path.abspath(path))  # links keep the names that the user gave them
        if whole.is_relative_to(PACKAGE_ROOT):
            return PACKAGE + whole.relative_to(PACKAGE_ROOT).as_posix()
        here = Path(os.path.abspath(self.path))
        try:
            if os.path.commonpath([whole, here]) != whole.anchor:
                return Path(os.path.relpath(whole, here)).as_posix()
        except ValueError:  # another drive
            pass
        return str(whole)

    def located(self, remembered: str) -> Path:
        """Inverse of `remembered`."""
        if remembered.startswith(PACKAGE):
            return PACKAGE_ROOT / remembered.removeprefix(PACKAGE)
        place = Path(os.path.abspath(self.path / remembered))
        here = Path.cwd()
        return place.relative_to(here) if place.is_relative_to(here) else place

    def existing(self) -> Manifest:
        """The manifest of a run directory that must be there.

        Raises
        ------
        StageError
            There is none.
        InUseError
            There is none yet, and another process works in it.
        """
        manifest = self.manifest()
        if manifest is None:
            if (holder := worker(self.path)) is not None:
                raise in_use(self.path, holder)
            raise StageError("there is no run here (no run.json)", str(self.path), self._instead())
        return manifest

    def _instead(self) -> str:
        """What to do where there is no run: the folder may be a part of one, or that of a log."""
        above = self.path.resolve().parent
        if (above / MANIFEST).is_file():
            return f"It is a folder of the run {above.name}; give that one."
        named = shlex.quote(str(self.path))
        below = sorted(self.path.glob(f"*/{MANIFEST}"))
        if below:
            some = ", ".join(shlex.quote(str(place.parent)) for place in below[:NAMED_RUNS])
            return f"Give one of the runs in it: {some}{', ...' * (len(below) > NAMED_RUNS)}."
        if self.path.is_dir() and any(p.name != LOCK_FILE for p in self.path.iterdir()):
            return (
                f"If it is the folder of a log, `auvident run {named} --vehicle V.toml --run RUN` "
                "makes a run of it."
            )
        return f"Run `auvident ingest LOG... --vehicle V.toml --run {named}` first."


def _in_the_way(place: Path) -> UsageError:
    return UsageError(
        "was not written by auvident and would be overwritten",
        str(place),
        "Move it away, or use another run directory.",
    )
