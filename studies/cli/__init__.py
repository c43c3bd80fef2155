"""The command line: its entry point, its verbs and their options."""

from studies.cli.entry_point import main as main
