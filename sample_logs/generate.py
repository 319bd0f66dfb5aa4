"""Make a sea-trial log: ``python sample_logs/generate.py RECIPE.toml --out DIR [--truth FILE]``."""

from __future__ import annotations

import argparse
import json
import sys
import tomllib
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))

from seatrial.trial import generate


def main() -> None:
    """Read the recipe, write the log folder and, where asked for, the truth."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("recipe", type=Path, help="recipe (TOML): name, vehicle, seed, ...")
    parser.add_argument("--out", type=Path, required=True, help="folder for the CSV files")
    parser.add_argument("--truth", type=Path, help="file for the truth (JSON)")
    parser.add_argument("--spread", type=float, help="random factors on the plant parameters")
    arguments = parser.parse_args()
    recipe = tomllib.loads(arguments.recipe.read_text(encoding="utf-8"))
    if arguments.spread is not None:
        recipe["spread"] = arguments.spread
    truth = generate(recipe, arguments.out)
    if arguments.truth is not None:
        arguments.truth.write_text(json.dumps(truth, indent=2) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
