"""The Python interface: runs, models and estimates as objects, for notebooks and programs.

Thin classes over the functions that the command line calls (`auvident.pipeline`): nothing is
computed here. The names that users take stand in `auvident` itself.
"""
