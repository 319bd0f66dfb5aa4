"""``auvident`` as the process of one trial, which ends with the process that started it.

A worker, or a whole campaign, that is killed would otherwise leave its trials at work, which keep
their run directories from whoever goes on with them.
"""

import os
import runpy
import signal
import sys

STARTED_BY = "AUVIDENT_STARTED_BY"  # environment variable: the process that waits for this one
PR_SET_PDEATHSIG = 1  # prctl(2)


def end_with_starter() -> None:
    """Be killed when the process that started this one dies; only Linux knows how."""
    starter = os.environ.pop(STARTED_BY, "")
    if sys.platform != "linux" or not starter:
        return
    import ctypes

    ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
    if os.getppid() != int(starter):  # it was faster
        os.kill(os.getpid(), signal.SIGKILL)


if __name__ == "__main__":
    end_with_starter()
    runpy.run_module("auvident", run_name="__main__", alter_sys=True)
