"""All poses of a set of readings by an exhaustive search, against which those of the decoder are held."""

import numpy as np

from analytic.inverse import pose_search


def exhaustive(coder, field):
    """All poses of one set of readings, from starts all over the workspace."""
    field = np.ascontiguousarray(field)
    axes = [np.linspace(a + 0.01, b - 0.01, n) for a, b, n in zip(coder.low, coder.high, (11, 11, 6), strict=True)]
    starts = np.stack(np.meshgrid(*axes, indexing="ij")).reshape(3, -1).T
    goal = coder.goal._replace(floor=coder.low - 0.5, roof=coder.high + 0.5)
    ends = [
        pose_search.newton(start, np.inf, field, coder.forward.kernel, goal) for start in np.ascontiguousarray(starts)
    ]
    found = np.array([shift[0] if end == pose_search.POSE else np.full(3, np.nan) for end, shift, _ in ends])
    inside = (found > coder.low - 1e-6).all(axis=1) & (found < coder.high + 1e-6).all(axis=1)
    distinct = []
    for pose in found[inside]:
        if all(np.abs(pose - other).max() > 2e-5 for other in distinct):
            distinct.append(pose)
    return np.array(distinct)
