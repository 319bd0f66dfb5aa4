"""Processor time for the few tests with a ceiling: generous, so that no busy machine fails one."""

import time
from collections.abc import Callable


def least_of_three(work: Callable[[], object]) -> float:
    """Processor seconds of the quickest of three; others on the machine only add to it."""

    def seconds() -> float:
        start = time.process_time()
        work()
        return time.process_time() - start

    return min(seconds() for _ in range(3))
