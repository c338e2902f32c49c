"""What the tests of pages share."""

import pytest
from browser import Browser, find_browser


@pytest.fixture(scope="module")
def browser():
    browser = Browser(find_browser())
    yield browser
    browser.close()
