"""Filters, and the fit of the free-running prediction, on the equations of motion."""
