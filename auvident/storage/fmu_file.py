"""An FMU as bytes: its files packed, with the library where a C compiler builds it.

The same files make the same bytes: times in the archive are fixed, and the library holds no path.
"""

import io
import platform
import shutil
import subprocess
import sys
import tempfile
import zipfile
from collections.abc import Mapping
from pathlib import Path

COMPILERS = ("cc", "gcc", "clang")
# exact arithmetic, as the Python form has it: no products and sums in one rounding
FLAGS = ("-std=c99", "-O2", "-ffp-contract=off", "-fPIC", "-shared", "-fvisibility=hidden")
GNU_FLAGS = ("-s", "-Wl,--build-id=none")
LONGEST_S = 120.0  # that a compiler may take
FIRST_TIME = (1980, 1, 1, 0, 0, 0)  # earliest of a ZIP file
RIGHTS = 0o644 << 16
# platform -> folder of FMI 2.0, ending of a library
PLACES = {
    ("linux", "x86_64"): ("linux64", ".so"),
    ("darwin", "x86_64"): ("darwin64", ".dylib"),
    ("darwin", "arm64"): ("darwin64", ".dylib"),
}


def packed(files: Mapping[str, bytes]) -> bytes:
    """Files as a ZIP archive that depends on nothing else."""
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in sorted(files.items()):
            entry = zipfile.ZipInfo(name, FIRST_TIME)
            entry.compress_type, entry.create_system = zipfile.ZIP_DEFLATED, 3
            entry.external_attr = RIGHTS
            archive.writestr(entry, content)
    return stream.getvalue()


def with_library(
    files: Mapping[str, bytes], source: str, name: str
) -> tuple[dict[str, bytes], str]:
    """The files and the library of one of them, for this platform; else why there is none.

    Parameters
    ----------
    files : mapping
    source : str
        Path of the C source among them.
    name : str
        Of the library, without ending.
    """
    place = PLACES.get((sys.platform, platform.machine()))
    compiler = next((found for c in COMPILERS if (found := shutil.which(c))), None)
    if place is None:
        return dict(files), f"FMI 2.0 has no name for {sys.platform} on {platform.machine()}"
    if compiler is None:
        return dict(files), "there is no C compiler here"
    folder, ending = place
    library, problem = _compiled(compiler, files[source], f"{name}{ending}")
    if problem:
        return dict(files), problem
    return {**files, f"binaries/{folder}/{name}{ending}": library}, ""


def _compiled(compiler: str, source: bytes, name: str) -> tuple[bytes, str]:
    """The library, or what the compiler said last."""
    gnu = GNU_FLAGS if sys.platform == "linux" else ()
    with tempfile.TemporaryDirectory(prefix="auvident-fmu-") as folder:
        Path(folder, "model.c").write_bytes(source)
        command = [compiler, *FLAGS, *gnu, "-o", name, "model.c", "-lm"]
        try:
            done = subprocess.run(
                command, cwd=folder, capture_output=True, text=True, timeout=LONGEST_S, check=False
            )
        except (OSError, subprocess.TimeoutExpired) as error:
            return b"", f"the C compiler failed: {error}"
        if done.returncode != 0:
            said = (done.stderr.strip() or f"code {done.returncode}").splitlines()[-1]
            return b"", f"the C compiler failed: {said}"
        return Path(folder, name).read_bytes(), ""
