"""The command line: parse, one call of the pipeline, translate the error.

Nothing heavy is imported here; `auvident --help` is there at once.
"""

import os
import sys
from contextlib import suppress
from typing import NoReturn

import click

from auvident import __version__
from auvident.cli import failures, interrupt
from auvident.cli.common import Group, ending
from auvident.cli.streams import outlive_readers
from auvident.errors import AuvidentError

INTERRUPTED_EXIT_CODE = 130  # 128 + SIGINT, as shells count
# Objects, young ones, middle ones: what a command makes it mostly keeps until it ends, and looking
# through all of it for cycles at every 700th new object took a fifth of the time of a report. The
# modules alone are 230,000 objects; a whole run makes 400,000, and of them no memory that counts
# lies in cycles.
COLLECTED_AFTER = (500_000, 50, 100)
# pydantic looks for plugins among all packages that are installed, and no plugin has a part in what
# is read here
os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")
EPILOG = ending(
    "auvident run sample_logs/harbour_trial --vehicle sample_logs/remus100.toml --run runs/demo"
)
# Modules with the commands, and the commands each holds, in the order of the help.
COMMANDS = {
    "auvident.cli.stages": ("run", "ingest", "segment", "ase", "identify", "validate"),
    "auvident.cli.loop": ("diagnose", "refine", "report"),
    "auvident.cli.results": ("status", "compare", "simulate", "plan-trial", "export"),
    "auvident.cli.combine": ("combine",),
    "auvident.cli.campaign": ("pool", "campaign", "warm-up"),
    "auvident.cli.tables": ("new-vehicle", "inspect", "coefficients", "effects", "schema"),
    "auvident.cli.completion": ("completion",),
}


@click.group(cls=Group, sources=COMMANDS, epilog=EPILOG)
@click.option(
    "--version",
    is_flag=True,
    expose_value=False,
    callback=lambda *given: _show_version(*given),
    help="Show the version and exit; with --verbose also those of the libraries.",
)
@click.option("--verbose", is_flag=True, is_eager=True, hidden=True)
def cli(verbose: bool) -> None:
    """Maneuvering models of autonomous underwater vehicles from their sea-trial logs.

    `auvident run` does everything; the other commands do one step each on its run directory.
    Exit codes: 0 done, 1 a gate was not met, 2 wrong usage, 3 unusable input, 4 an earlier stage
    is missing or stale, 5 numerical failure, 6 the run directory is in use by another process,
    130 interrupted.
    """
    if verbose:
        raise click.UsageError("--verbose stands behind the command, or beside --version.")


def _show_version(ctx: click.Context, parameter: click.Parameter, asked: bool) -> None:
    """One line, or everything that a result or a fault may depend on."""
    if not asked or ctx.resilient_parsing:
        return
    if ctx.params.get("verbose"):  # read before, as it is eager
        from auvident.jit import cache_folder
        from auvident.versions import about

        click.echo("\n".join([*about(), f"compiled kernels in {cache_folder()}"]))
    else:
        click.echo(f"auvident, version {__version__}")
    ctx.exit()


def main(arguments: list[str] | None = None) -> None:
    """Run the command line and leave with its exit code."""
    if arguments is None:
        outlive_readers()
    code = _run(arguments)
    if arguments is None:  # the process of a command, which ends now
        _leave(code)
    sys.exit(code)


def _run(arguments: list[str] | None) -> int:
    try:
        interrupt.listen()
        _quiet_libraries()
        _one_thread()
        _collect_rarely()
        result = cli.main(args=arguments, prog_name="auvident", standalone_mode=False)
        failures.close_output()
        return result if isinstance(result, int) else 0
    except click.ClickException as error:
        return failures.misused(error)
    except AuvidentError as error:
        return failures.told(error)
    except (KeyboardInterrupt, click.Abort):
        return _interrupted()
    except OSError as error:
        failures.forget_output()
        return _interrupted() if interrupt.was_asked() else failures.from_outside(error)
    except MemoryError:
        return failures.told(failures.NO_MEMORY)
    except Exception as error:
        return _interrupted() if interrupt.was_asked() else failures.bug(error)


def _interrupted() -> int:
    interrupt.heeded()
    text = (
        "Interrupted. What completed stages wrote stands, and the same command goes on from there."
    )
    click.echo(text, err=True)
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


def _collect_rarely() -> None:
    """Look for garbage that counting references does not find less often than Python does."""
    import gc

    gc.set_threshold(*COLLECTED_AFTER)


def _leave(code: int) -> NoReturn:
    """End the process, and let the system take back its memory at once.

    To take apart all modules and objects first took as long as reading a log.
    """
    import atexit

    atexit._run_exitfuncs()  # what was to be done at the end is done
    for stream in (sys.stdout, sys.stderr):
        with suppress(OSError, ValueError):  # closed, or its reader has left
            stream.flush()
    os._exit(code)
