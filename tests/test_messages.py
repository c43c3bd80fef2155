"""Warnings of the packages below the command line."""

import logging

from geometry import messages
from studies.output import console


def test_a_warning_comes_once_and_reads_as_those_of_the_command_line(caplog, capsys):
    messages.warn_once.cache_clear()
    with caplog.at_level(logging.WARNING):
        for text in ("the cache is full", "the cache is full", "the disk is full"):
            messages.warn_once(text)
    first, second = (record.getMessage() for record in caplog.records)
    assert second == "magtip: warning: the disk is full"
    console.warn("the cache is full")
    assert capsys.readouterr().err == first + "\n"
