"""The run directory: artifacts by stage, the manifest, and a lock while a stage writes."""

import errno
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

from auvident.errors import InputError, StageError, UsageError
from auvident.schema.manifest import Manifest
from auvident.storage.artifacts import (
    TEMPORARY_SUFFIX,
    json_bytes,
    read_model,
    sha256_of,
    write_bytes,
)

try:
    import fcntl
except ImportError:  # not on Windows: no lock there
    fcntl = None  # type: ignore[assignment]

MANIFEST = "run.json"
PACKAGE = "package:"  # path of a file that comes with the program
PACKAGE_ROOT = Path(__file__).resolve().parents[1]


class RunDirectory:
    """A run directory on disk.

    Parameters
    ----------
    path : Path
        It need not exist; nothing is created before the first `commit`.
    """

    def __init__(self, path: Path) -> None:
        self.path = Path(path)
        if self.path.exists() and not self.path.is_dir():
            raise UsageError("is a file, not a run directory", str(path), "Name another folder.")

    def __truediv__(self, relative: str) -> Path:
        return self.path / relative

    def manifest(self) -> Manifest | None:
        """The manifest, or None when there is none yet.

        Raises
        ------
        StageError
            It is damaged, or of a later version of the program.
        """
        place = self.path / MANIFEST
        if not place.exists():
            return None
        remedy = "It was not written by this program; use another run directory."
        return read_model(place, Manifest, remedy)

    @contextmanager
    def lock(self) -> Iterator[None]:
        """Keep other processes from writing; the system releases it when the process dies.

        Raises
        ------
        UsageError
            Another process has it.
        """
        self._create()
        descriptor = os.open(self.path, os.O_RDONLY) if fcntl else None
        try:
            if descriptor is not None:
                self._take(descriptor)
            self._remove_partial_files()
            yield
        finally:
            if descriptor is not None:
                os.close(descriptor)

    def _create(self) -> None:
        try:
            self.path.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise InputError(
                f"cannot be created: {error.strerror}", str(self.path), "Name another folder."
            ) from None

    def _take(self, descriptor: int) -> None:
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            if error.errno in (errno.EWOULDBLOCK, errno.EACCES):
                raise UsageError(
                    "another auvident process is working in this run directory",
                    str(self.path),
                    "Wait for it to end, or use another run directory.",
                ) from None
            # a file system without locks: nothing to be done about it

    def _remove_partial_files(self) -> None:
        """Leftovers of a killed process; only with the lock, else they may be alive."""
        for pattern in (f".*{TEMPORARY_SUFFIX}", f"*/.*{TEMPORARY_SUFFIX}"):
            for leftover in self.path.glob(pattern):
                leftover.unlink(missing_ok=True)

    def commit(self, outputs: Mapping[str, bytes], obsolete: frozenset[str] = frozenset()) -> None:
        """Write the outputs of a stage and remove those that it no longer has.

        The manifest follows by `save`: a process killed in between leaves outputs that do not
        fit the manifest, so the stage counts as stale and runs again.
        """
        try:
            for relative, content in outputs.items():
                write_bytes(self.path / relative, content)
            for relative in obsolete - outputs.keys():
                (self.path / relative).unlink(missing_ok=True)
        except OSError as error:
            raise self._cannot_write(error) from None

    def save(self, manifest: Manifest) -> None:
        """Replace the manifest."""
        try:
            write_bytes(self.path / MANIFEST, json_bytes(manifest, MANIFEST))
        except OSError as error:
            raise self._cannot_write(error) from None

    def _cannot_write(self, error: OSError) -> InputError:
        place = error.filename or str(self.path)
        return InputError(
            f"cannot be written: {error.strerror}", str(place), "Check the disk and the rights."
        )

    def sha256(self, relative: str) -> str | None:
        """Hash of an artifact; None when it is missing."""
        return sha256_of(self.path / relative)

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
        """
        manifest = self.manifest()
        if manifest is None:
            raise StageError(
                "there is no run here (no run.json)",
                str(self.path),
                f"Run `auvident ingest LOG... --vehicle V.toml --run {self.path}` first.",
            )
        return manifest
