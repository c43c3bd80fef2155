"""The exit statuses of all verbs."""

from __future__ import annotations

GOOD, BAD, FAILED, INTERRUPTED, BROKEN_PIPE = 0, 2, 3, 130, 141
"""Success; bad input; a failed solve or check; Ctrl-C; the process that reads the output has ended. 1 is a bug."""
