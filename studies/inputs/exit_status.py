"""The exit statuses of all verbs."""

from __future__ import annotations

GOOD, BAD, FAILED, INTERRUPTED, BROKEN_PIPE = 0, 2, 3, 130, 141
"""Success; bad input; a solve or a check failed; Ctrl-C; the reader of the output is gone. 1 is a bug."""
