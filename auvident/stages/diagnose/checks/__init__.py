"""Checks: sensors against each other, one-off events and waves; no model of the vehicle."""
