"""A picture of the head of a report for the README, drawn by Chromium where it is installed."""

import shutil
import subprocess
import tempfile
from pathlib import Path

from PIL import Image

BROWSERS = ("chromium", "chromium-browser", "google-chrome")
SIZE = (1000, 900)  # px, of the window: the summary and the errors
COLOURS = 32  # of the palette; the page has few, and the letters stay sharp
SECONDS = 60.0


def browser() -> str | None:
    """Chromium, under any of its names."""
    return next(filter(None, map(shutil.which, BROWSERS)), None)


def write(report: Path, picture: Path) -> None:
    """The head of an HTML report as a small PNG.

    Raises
    ------
    RuntimeError
        Where there is no browser to draw it.
    """
    program = browser()
    if program is None:
        raise RuntimeError(f"install one of {', '.join(BROWSERS)} for the picture of the report")
    with tempfile.TemporaryDirectory() as folder:
        shot = Path(folder) / "shot.png"
        options = ("--headless", "--no-sandbox", "--disable-gpu", "--no-first-run")
        size = f"--window-size={SIZE[0]},{SIZE[1]}"
        own = (f"--user-data-dir={folder}/profile", "--hide-scrollbars", f"--screenshot={shot}")
        command = [program, *options, *own, size, report.resolve().as_uri()]
        subprocess.run(command, check=True, capture_output=True, timeout=SECONDS)
        with Image.open(shot) as image:
            few = image.convert("RGB").quantize(COLOURS, dither=Image.Dither.NONE)
        few.save(picture, optimize=True)
