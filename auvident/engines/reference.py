"""The same passes on filterpy's classes: the independent, slow engine."""

import numpy as np


def run(problem, kind, spread=1.0):
    raise NotImplementedError
