"""Fit: the free-running prediction with chosen effects, and what it leaves."""
