"""The verbs about meshes in general: cache, range."""

from __future__ import annotations

from studies import console
from studies.options import GOOD, AsJson


def cache(*, clear: bool = False, as_json: AsJson = False) -> int:
    """Where meshes are kept, how many, their size and its limit (environment: MAGTIP_CACHE, MAGTIP_CACHE_MB).

    Parameters
    ----------
    clear
        Remove them.
    """
    from geometry import cache as kept

    found = kept.clear() if clear else kept.contents()
    record = {
        "folder": kept.OFF if found.folder is None else found.folder,
        "files": found.files,
        "size_MB": found.size / 1e6,
        "limit_MB": found.limit / 1e6,
    }
    console.report([record], as_json=as_json, title="Cache of meshes")
    return GOOD
