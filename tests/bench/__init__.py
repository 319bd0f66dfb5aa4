"""Benchmarks: speed of the filters, cost of an identification, honesty of its uncertainties."""
