"""All poses of a set of readings by an exhaustive search, against which those of the decoder are held."""

import numpy as np

from analytic.inverse import damped_newton


def exhaustive(coder, field):
    """All poses of one set of readings, from starts all over the workspace."""
    axes = [np.linspace(a + 0.01, b - 0.01, n) for a, b, n in zip(coder.low, coder.high, (11, 11, 6), strict=True)]
    starts = np.stack(np.meshgrid(*axes, indexing="ij")).reshape(3, -1)
    target = np.repeat(field[:, None], starts.shape[1], axis=1)
    low, high = coder.low - 0.5, coder.high + 0.5
    s, f, A, done = damped_newton.refine(coder.forward, starts, target, np.ones(len(field)), low, high)
    inside = (s > coder.low[:, None] - 1e-6).all(axis=0) & (s < coder.high[:, None] + 1e-6).all(axis=0)
    exact = np.sqrt((f**2).sum(axis=0)) < 1e-7 * np.sqrt((A**2).sum(axis=(0, 1)))
    distinct = []
    for pose in s[:, done & inside & exact].T:
        if all(np.abs(pose - other).max() > 2e-5 for other in distinct):
            distinct.append(pose)
    return np.array(distinct)
