"""One set of synthetic stores for all tests of the paper."""

import pytest
import synthetic_paper


@pytest.fixture(scope="session")
def sound():
    return synthetic_paper.stores()
