"""The exception family: what is wrong, where, what to do, and the exit code.

Built-in exceptions that escape the library are bugs; everything a user can cause is one of
these. Library code never prints and never exits.
"""

from collections.abc import Sequence

BUG_EXIT_CODE = 70  # EX_SOFTWARE of sysexits.h: the program is at fault, not its user


class AuvidentError(Exception):
    """A problem that the user can do something about.

    Parameters
    ----------
    problem : str
        What is wrong, one sentence.
    where : str, optional
        File, row, column, table, maneuver or time it concerns.
    remedy : str, optional
        What to do about it.
    """

    exit_code = 1

    def __init__(self, problem: str, where: str = "", remedy: str = "") -> None:
        super().__init__(problem)
        self.problem, self.where, self.remedy = problem, where, remedy

    def __str__(self) -> str:
        text = f"{self.where}: {self.problem}" if self.where else self.problem
        return f"{text}\n  {self.remedy}" if self.remedy else text


class GateError(AuvidentError):
    """A gate that the user asked for was not met (``--fail-above``)."""

    exit_code = 1


class UsageError(AuvidentError):
    """The command was called in a way that cannot work."""

    exit_code = 2


class InputError(AuvidentError):
    """A log, vehicle, map or plan file cannot be used.

    `lacks` is the column of a needed channel that a log has not; else empty.
    """

    exit_code = 3

    def __init__(self, problem: str, where: str = "", remedy: str = "", lacks: str = "") -> None:
        super().__init__(problem, where, remedy)
        self.lacks = lacks


def together(errors: Sequence[InputError]) -> InputError:
    """Errors of one log as one, so that they can be put right together; of one it is itself.

    Each problem is told once, and the remedy of each has a line of its own.
    """
    first, *others = errors
    if not others:
        return first
    places = list(dict.fromkeys(e.where for e in errors))
    alone = len(places) == 1
    problems = [e.problem if alone else f"{e.problem} ({e.where})" for e in errors]
    remedies = [e.remedy for e in errors if e.remedy]
    return InputError(
        "; ".join(dict.fromkeys(problems)),
        places[0] if alone else "",
        "\n  ".join(dict.fromkeys(remedies)),
        first.lacks,
    )


class ContradictionError(InputError):
    """What was logged contradicts the vehicle file or itself, beyond doubt.

    `check` names what ``--fix`` takes, and `fix` the correction; empty where there is none.
    """

    def __init__(
        self, problem: str, where: str = "", remedy: str = "", check: str = "", fix: str = ""
    ) -> None:
        super().__init__(problem, where, remedy)
        self.check, self.fix = check, fix


class StageError(AuvidentError):
    """A needed earlier stage is missing or stale."""

    exit_code = 4


class NumericsError(AuvidentError):
    """The numbers failed: divergence, loss of positive definiteness, no excitation."""

    exit_code = 5


class InUseError(AuvidentError):
    """The run directory is in use by another process."""

    exit_code = 6
