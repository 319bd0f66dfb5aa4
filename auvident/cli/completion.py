"""The script with which a shell completes commands, options, files and maneuvers."""

import json
from pathlib import Path
from typing import Any

import click
from click.shell_completion import CompletionItem, get_completion_class

from auvident.cli.common import Output, command

SHELLS = ("bash", "zsh", "fish")
PROGRAM, VARIABLE = "auvident", "_AUVIDENT_COMPLETE"


@command("completion", "auvident completion bash")
@click.argument("shell", type=click.Choice(SHELLS))
def completion(output: Output, shell: str) -> None:
    """Print the script with which a shell completes what is typed.

    Commands, options and their values, files, and the maneuvers of the run directory are
    completed. To have it in every new shell:

    \b
      bash  echo 'eval "$(auvident completion bash)"' >> ~/.bashrc
      zsh   echo 'eval "$(auvident completion zsh)"' >> ~/.zshrc
      fish  auvident completion fish > ~/.config/fish/completions/auvident.fish
    """
    from auvident.cli import cli

    shell_class = get_completion_class(shell)
    assert shell_class is not None
    script = shell_class(cli, {}, PROGRAM, VARIABLE).source()
    if not output.json:
        output.text(script.strip("\n"))
    made = {"schema": "auvident/completion/1", "shell": shell, "script": script}
    output.artifact(made, "completion")


def maneuvers(ctx: click.Context, param: click.Parameter, incomplete: str) -> list[str]:
    """Maneuvers and trials of the run directory that stands on the line, as far as it is typed."""
    found = [m for m in _read(ctx, "segment/maneuvers.json", []) if isinstance(m, dict)]
    names = [*(m.get("trial") for m in found), *(m.get("id") for m in found)]
    return _beginning(names, incomplete)


def channels(ctx: click.Context, param: click.Parameter, incomplete: str) -> list[str]:
    """Channels that the held-out maneuvers of the run directory are judged by, ``u=``."""
    summary = _read(ctx, "validate/metrics.json").get("summary", {})
    return _beginning((f"{name}=" for name in summary.get("validate", {})), incomplete)


def plans(ctx: click.Context, param: click.Parameter, incomplete: str) -> list[Any]:
    """The built-in plans, and files."""
    folder = Path(__file__).parents[1] / "plans"
    names = _beginning(sorted(p.stem for p in folder.glob("*.toml")), incomplete)
    return [*map(CompletionItem, names), CompletionItem(incomplete, type="file")]


def desk_maneuvers(ctx: click.Context, param: click.Parameter, incomplete: str) -> list[str]:
    """Names of the standard maneuvers."""
    from auvident.schema.desk import BY_MANEUVER

    return _beginning(BY_MANEUVER, incomplete)


def schemas(ctx: click.Context, param: click.Parameter, incomplete: str) -> list[str]:
    """Names of the schemas."""
    from auvident.pipeline.schemas import SCHEMAS

    return _beginning(SCHEMAS, incomplete)


def _beginning(names: Any, typed: str) -> list[str]:
    """Each name once that begins with what is typed."""
    return [n for n in dict.fromkeys(names) if isinstance(n, str) and n.startswith(typed)]


def _read(ctx: click.Context, name: str, nothing: Any = None) -> Any:
    """An artifact of the run directory on the line; nothing where it cannot be read."""
    nothing = {} if nothing is None else nothing
    run = ctx.params.get("run") or next(iter(ctx.args), "")  # the parser stops at a bare option
    if not run:
        return nothing
    try:
        found = json.loads((Path(run) / name).read_text(encoding="utf-8"))
    except (OSError, ValueError):  # a shell that completes has nobody to tell it to
        return nothing
    return found if isinstance(found, type(nothing)) else nothing
