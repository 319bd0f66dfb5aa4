"""Verdict: what the evidence supports, how well it is known, and the artifact."""
