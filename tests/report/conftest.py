"""The pages of the report share their figures."""

import pytest


@pytest.fixture(autouse=True)
def shared_figures(figures_drawn_once: None) -> None:
    """For all tests of this folder."""
