"""The short run and its judge, as fixtures."""

import pytest

from tests.helpers.short_run import SCENARIO, judge_of, short_run


@pytest.fixture
def run():
    return short_run()


@pytest.fixture
def judge():
    return judge_of(SCENARIO)
