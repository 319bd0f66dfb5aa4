"""What is in the wheel and in the source distribution."""

import shutil
import subprocess
import sys
import tarfile
import tomllib
import zipfile
from email import message_from_bytes
from pathlib import Path

import pytest

from tests.command_line import ROOT

BUILD = """
import sys
from setuptools import build_meta
_, folder = sys.argv  # which setuptools changes
build_meta.build_sdist(folder)
build_meta.build_wheel(folder)
"""
FILES = ("pyproject.toml", "MANIFEST.in", "README.md", "LICENSE", "CITATION.cff")
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]


def in_package() -> set[str]:
    """Every file of the package."""
    found = (ROOT / "auvident").rglob("*")
    return {p.relative_to(ROOT).as_posix() for p in found if p.is_file() and _is_source(p)}


def _is_source(path: Path) -> bool:
    return "__pycache__" not in path.parts and not path.name.startswith(".")


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with both, built from a copy that has tests and logs as well."""
    pytest.importorskip("setuptools", minversion="77")  # as pyproject.toml asks for
    copy, built = (tmp_path_factory.mktemp(name) for name in ("copy", "dist"))
    ignored = shutil.ignore_patterns("__pycache__", ".*")
    shutil.copytree(ROOT / "auvident", copy / "auvident", ignore=ignored)
    for name in FILES:
        shutil.copy(ROOT / name, copy)
    for other in ("tests/test_one.py", "sample_logs/bay/dvl.csv", "docs/method.md"):
        (copy / other).parent.mkdir(parents=True, exist_ok=True)
        (copy / other).touch()
    done = subprocess.run(
        [sys.executable, "-c", BUILD, str(built)], cwd=copy, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    return built


def test_the_wheel_has_the_whole_package_and_nothing_else(built: Path) -> None:
    (wheel,) = built.glob("*.whl")
    names = zipfile.ZipFile(wheel).namelist()
    assert {n for n in names if ".dist-info/" not in n} == in_package()
    assert any(n.endswith("licenses/LICENSE") for n in names)


def test_the_source_distribution_has_what_it_takes_to_build(built: Path) -> None:
    (archive,) = built.glob("*.tar.gz")
    with tarfile.open(archive) as files:
        names = {n.partition("/")[2] for n in files.getnames()}
    assert names >= in_package() | set(FILES)
    assert not {n for n in names if n.startswith(("tests", "sample_logs", "docs"))}


def test_the_metadata_tell_what_it_is(built: Path) -> None:
    (wheel,) = built.glob("*.whl")
    archive = zipfile.ZipFile(wheel)
    (name,) = (n for n in archive.namelist() if n.endswith("/METADATA"))
    found = message_from_bytes(archive.read(name))
    assert found["Name"] == "auvident" and found["Version"] == PROJECT["version"]
    assert found["License-Expression"] == "MIT"
    assert found["Keywords"] and "Typing :: Typed" in found.get_all("Classifier", [])
    assert found["Requires-Python"] == ">=3.11"
    (scripts,) = (n for n in archive.namelist() if n.endswith("/entry_points.txt"))
    assert "auvident = auvident.cli:main" in archive.read(scripts).decode()


def test_the_package_is_as_old_as_its_classifiers_say() -> None:
    versions = [c.rpartition(" ")[2] for c in PROJECT["classifiers"] if ":: Python :: 3." in c]
    assert versions[0] == PROJECT["requires-python"].removeprefix(">=")
