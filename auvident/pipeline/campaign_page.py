"""The page of a campaign, written into its output."""

from pathlib import Path

from auvident.pipeline.campaign import CampaignRun
from auvident.storage.artifacts import write_bytes
from auvident.storage.campaign_file import PAGE


def write_page(output: Path, done: CampaignRun) -> Path:
    """Write the page; its place."""
    from auvident.report.campaign_page import render_campaign

    models = {name: runs.model for name, runs in done.pooled.items()}
    write_bytes(output / PAGE, render_campaign(done.result, models).encode())
    return output / PAGE
