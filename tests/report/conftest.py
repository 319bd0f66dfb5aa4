"""The pages of the report share their figures."""

from collections.abc import Iterator

import pytest

from tests.report import drawings


@pytest.fixture(scope="package", autouse=True)
def figures_drawn_once() -> Iterator[None]:
    with drawings.each_once():
        yield
