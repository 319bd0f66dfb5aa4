"""Pages and pictures of docs/ that the program makes: ``python -m tests.bench.pages [RUN ...]``.

Without RUN the pages of effects, commands and findings are written, and the pictures of effects;
with the run directory of ``make demo`` on ``bay_trial`` the first picture of the README and that of
its report, too, and with ``runs/tanker`` the second.
"""

import io
import json
import sys
from pathlib import Path
from typing import Any

import pandas as pd
from matplotlib.figure import Figure

from auvident.report.figures import BLUE, INK, VERMILLION, new_figure, style
from auvident.schema.effects import LENGTH, TIME
from tests.bench import reference, report_picture, signatures
from tests.bench.written import table
from tests.command_line import call

DOCS = Path(__file__).resolve().parents[2] / "docs"
HEAD = """# Effects

<!-- written by `make docs` from the program's own table; not to be edited -->

What `diagnose` tries, as the program prints it; `auvident effects --json` has the bounds besides.
[Reading the results](run-directory.md) says what becomes of them.

```console
$ auvident effects
"""
NEXT = """```

## What each does to the residuals

Measured less predicted by a model without the effect, in three maneuvers of a vehicle of 1.6 m at
1.4 m/s. Each effect has the size that stands beside its name. The coefficients are not fitted again
here; a fit takes up what they can explain, and `diagnose` tells the effect by the rest. Effects in
one picture look alike or act at the same place.

"""
EQUATIONS = """## Equations

An effect that enters at the input changes what becomes of a command, a force stands in the
equations of motion, a reading is what the sensor makes of the motion; a disturbance is named but
stands in no model (of an event the rows are masked). "Allowed" is the standard deviation with
which it is adjusted along as a nuisance parameter, as no servo is without lag and no hull without
asymmetry.

"""
SIGNATURES = "img/effects"
ENDS = {"input": "input", "force": "force", "reading": "reading", "disturbance": "no model"}


def main(arguments: list[str]) -> None:
    """Write the page of effects, and a picture for each run directory that is given."""
    (DOCS / SIGNATURES).mkdir(parents=True, exist_ok=True)
    for page, made in WRITTEN_PAGES.items():
        (DOCS / page).write_text(made(), encoding="utf-8")
    for group in signatures.GROUPS:
        text = signatures.picture(group)
        (DOCS / SIGNATURES / f"{group}.svg").write_text(text, encoding="utf-8")
    for run in map(Path, arguments):
        name = PICTURES.get(run.name, OF_THE_DEMO)
        (DOCS / "img" / f"{name}.svg").write_text(picture(run), encoding="utf-8")
        report = run / "report" / "report.html"
        if name == OF_THE_DEMO and report.exists():
            report_picture.write(report, DOCS / "img" / "report.png")


# --- effects ------------------------------------------------------------------------------


def effects_page() -> str:
    """The page of effects as it should be."""
    found = json.loads(call("effects", "--json").out)["effects"]
    rows = [_effect(effect) for effect in found]
    shown = "".join(
        f"**{group.title}**\n\n![{signatures.alt(name)}]({SIGNATURES}/{name}.svg)\n\n"
        for name, group in signatures.GROUPS.items()
    )
    without = "; ".join(f"`{effect}` {why}" for effect, why in signatures.NO_PICTURE.items())
    pictures = f"{shown}Without a picture: {without}.\n\n"
    return HEAD + call("effects").out + NEXT + pictures + EQUATIONS + table(rows) + "\n"


OR_RATE = " or a yaw rate without gaps"


def _effect(effect: dict[str, Any]) -> dict[str, str]:
    allowed = [_allowed(p) for p in effect["parameters"] if p["nuisance_std"] > 0.0]
    return {
        "effect": f"`{effect['id']}`",
        "enters": ENDS[effect["enters"]],
        "planes": ", ".join(effect["planes"]),
        "equation": effect["equation"],
        "needs": ", ".join(f"`{c}`" for c in effect["needs"]) + OR_RATE * effect["by_rate"],
        "allowed": ", ".join(allowed),
        "source": effect["source"],
    }


WRITTEN_PAGES = {
    "effects.md": effects_page,
    "commands.md": reference.commands_page,
    "findings.md": reference.findings_page,
}
OF_THE_VEHICLE = {TIME: "L/U", LENGTH: "L"}


def _allowed(parameter: dict[str, Any]) -> str:
    """The allowance as an engineer reads it; of forces and limits only that there is one."""
    unit = OF_THE_VEHICLE.get(tuple(parameter["powers"]))
    if parameter["form"] == "plain" and unit is not None:
        return f"{parameter['nuisance_std']:.2g} {unit}"
    if parameter["form"] != "plain" or any(parameter["powers"]):
        return f"{parameter['symbol']}: a little"
    return f"{parameter['nuisance_std'] * parameter['factor']:.2g} {parameter['unit']}"


# --- picture ------------------------------------------------------------------------------

CHANNELS = {
    "u": ("u_mps", "surge, m/s"),
    "v": ("v_mps", "sway, m/s"),
    "r": ("r_radps", "yaw, rad/s"),
}
LINES = (
    ("measured", INK, "-", 2.4, 0.4, "measured"),
    ("before", VERMILLION, (0, (4, 2)), 1.2, 1.0, "predicted by the identified model"),
    ("after", BLUE, "-", 1.2, 1.0, "with the effect it lacked"),
)
SIZE_IN = (9.6, 5.0)
OF_THE_DEMO = "held_out"
PICTURES = {"tanker": "tanker"}  # by run directory; of any other, the one of the demo
WIDE = 3  # maneuvers side by side, above it a title takes two lines
MOST_ROWS = 1500  # of a line; half of more are as many as can be seen
PAPER = "#ffffff"  # a page may be dark


def picture(run: Path) -> str:
    """Held-out maneuvers of a run, measured and predicted before and after `refine`, as SVG."""
    from matplotlib import rc_context

    told = json.loads((run / "refine/comparison.json").read_text(encoding="utf-8"))["held_out"]
    rows, gap = _series(run), " " if len(told["maneuvers"]) <= WIDE else "\n"
    with style(), rc_context({"svg.hashsalt": "held_out"}):
        figure = new_figure(SIZE_IN[1], SIZE_IN[0])
        panels = figure.subplots(
            len(CHANNELS), len(told["maneuvers"]), sharex="col", sharey="row", squeeze=False
        )
        for j, maneuver in enumerate(told["maneuvers"]):
            _column(panels[:, j], rows[rows["maneuver"] == maneuver], f"{maneuver}{gap}(held out)")
        for axes, (channel, (_, words)) in zip(panels[:, 0], CHANNELS.items(), strict=True):
            before, after = (told[when][channel]["nrmse"] for when in ("before", "after"))
            axes.set_ylabel(f"{words}\nNRMSE {before:.2f}, {after:.2f}")
        figure.legend(
            loc="upper center", ncols=len(LINES), handles=panels[0, 0].lines[: len(LINES)]
        )
        figure.tight_layout(rect=(0.0, 0.0, 1.0, 0.94))
        return _svg(figure)


def _series(run: Path) -> pd.DataFrame:
    """Measured, before and after, row by row."""
    before, after = (
        pd.read_parquet(run / s / "simulation.parquet") for s in ("validate", "refine")
    )
    columns = [column for column, _ in CHANNELS.values()]
    return before[["maneuver", "time_s"]].assign(
        **{f"{c}_measured": before[f"{c}_measured"] for c in columns},
        **{f"{c}_before": before[f"{c}_simulated"] for c in columns},
        **{f"{c}_after": after[f"{c}_simulated"] for c in columns},
    )


def _column(panels: Any, rows: pd.DataFrame, title: str) -> None:
    rows = rows[:: 1 + len(rows) // MOST_ROWS]
    time = rows["time_s"] - rows["time_s"].iloc[0]
    for axes, (column, _) in zip(panels, CHANNELS.values(), strict=True):
        for ending, colour, dashes, width, opacity, words in LINES:
            seen = rows[f"{column}_{ending}"].notna()  # a slow sensor leaves holes
            axes.plot(
                time[seen],
                rows.loc[seen, f"{column}_{ending}"],
                color=colour,
                ls=dashes,
                lw=width,
                alpha=opacity,
                label=words,
            )
        axes.set_xlim(0.0, time.max())
    panels[0].set_title(title)
    panels[-1].set_xlabel("time, s")


def _svg(figure: Figure) -> str:
    stream = io.StringIO()
    figure.savefig(stream, format="svg", metadata={"Date": None}, facecolor=PAPER)
    return stream.getvalue()


if __name__ == "__main__":
    main(sys.argv[1:])
