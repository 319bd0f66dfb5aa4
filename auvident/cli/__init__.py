"""The command line: parse, one call of the pipeline, translate the error.

Nothing heavy is imported here; `auvident --help` is there at once.
"""

import os
import sys

import click

from auvident import __version__
from auvident.cli import failures, interrupt
from auvident.cli.common import Group
from auvident.errors import AuvidentError

INTERRUPTED_EXIT_CODE = 130  # 128 + SIGINT, as shells count
EPILOG = """\b
Example:
  auvident run sample_logs/harbour_trial --vehicle sample_logs/remus100.toml --run runs/demo
"""
# Modules with the commands, and the commands each holds, in the order of the help.
COMMANDS = {
    "auvident.cli.stages": ("run", "ingest", "segment", "ase", "identify", "validate"),
    "auvident.cli.loop": ("diagnose", "refine", "report"),
    "auvident.cli.results": ("status", "compare", "simulate", "plan-trial", "export"),
    "auvident.cli.combine": ("combine",),
    "auvident.cli.campaign": ("pool", "campaign", "warm-up"),
    "auvident.cli.tables": ("new-vehicle", "inspect", "coefficients", "effects", "schema"),
}


@click.group(cls=Group, sources=COMMANDS, epilog=EPILOG)
@click.version_option(__version__, prog_name="auvident")
def cli() -> None:
    """Maneuvering models of autonomous underwater vehicles from their sea-trial logs.

    `auvident run` does everything; the other commands do one step each on its run directory.
    Exit codes: 0 done, 1 a gate was not met, 2 wrong usage, 3 unusable input, 4 an earlier stage
    is missing or stale, 5 numerical failure, 6 the run directory is in use by another process.
    """


def main(arguments: list[str] | None = None) -> None:
    """Run the command line and leave with its exit code."""
    sys.exit(_run(arguments))


def _run(arguments: list[str] | None) -> int:
    try:
        interrupt.listen()
        _quiet_libraries()
        _one_thread()
        result = cli.main(args=arguments, prog_name="auvident", standalone_mode=False)
        failures.close_output()
        return result if isinstance(result, int) else 0
    except click.ClickException as error:
        return failures.misused(error)
    except AuvidentError as error:
        return failures.told(error)
    except (KeyboardInterrupt, click.Abort):
        return _interrupted()
    except BrokenPipeError:  # the reader of a pipe has left
        failures.forget_output()
        return 0
    except OSError as error:
        failures.forget_output()
        return _interrupted() if interrupt.was_asked() else failures.from_outside(error)
    except MemoryError:
        return failures.told(failures.NO_MEMORY)
    except Exception as error:
        return _interrupted() if interrupt.was_asked() else failures.bug(error)


def _interrupted() -> int:
    interrupt.heeded()
    click.echo("Interrupted; the run directory is as the last completed stage left it.", err=True)
    return INTERRUPTED_EXIT_CODE


def _quiet_libraries() -> None:
    """Warnings of libraries are for developers; -W and PYTHONWARNINGS still show them."""
    import warnings

    if not sys.warnoptions:
        warnings.simplefilter("ignore")


def _one_thread() -> None:
    """Linear algebra on one thread, before numpy is loaded; whoever sets the number is heard.

    The matrices here are small: threads would only wait for each other.
    """
    for name in ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OMP_NUM_THREADS"):
        os.environ.setdefault(name, "1")
