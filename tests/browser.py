"""Headless Chromium for tests: the installed program, driven by Playwright."""

import contextlib
import shutil
import time

NAMES = ("chromium", "chromium-browser", "google-chrome", "chrome")
PATIENCE = 60.0
"""Longest time that a page may take for what a test waits for, s."""


def executable():
    """The path of an installed Chromium, or None."""
    return next((path for path in map(shutil.which, NAMES) if path), None)


@contextlib.contextmanager
def launched(*flags):
    """Start Playwright with a Chromium."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright, launch(playwright.chromium, *flags) as browser:
        yield browser


def launch(kind, *flags):
    """Start a Chromium that draws in 3D without a graphics card."""
    return kind.launch(executable_path=executable(), args=["--use-angle=swiftshader", *flags])


def opened(browser, path, width=1200, height=900, **options):
    """Open a file, or an address, in a new page of a size in pixels."""
    page = browser.new_page(viewport={"width": width, "height": height}, **options)
    page.set_default_timeout(1000 * PATIENCE)
    page.goto(path if isinstance(path, str) else path.resolve().as_uri())
    page.wait_for_selector("html[data-ready=yes]", state="attached")
    return page


def said(page):
    """What a page has said on its console: messages, loads that were refused or failed, errors."""
    return [message.text for message in page.console_messages()] + [str(error) for error in page.page_errors()]


def drag(page, start, end):
    """Press the mouse at a point, move it to another, release it."""
    page.mouse.move(*start)
    page.mouse.down()
    page.mouse.move(*end, steps=2)
    page.mouse.up()


def wait(page, condition):
    """Wait until a JavaScript condition holds; what Playwright has for it evaluates text, which the pages forbid."""
    end = time.monotonic() + PATIENCE
    while not page.evaluate(f"Boolean({condition})"):
        assert time.monotonic() < end, f"not reached: {condition}"
        page.wait_for_timeout(60)
