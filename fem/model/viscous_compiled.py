"""The stress that a time step of a viscoelastic law adds, in loops that numba compiles; see `overstress`.

Arrays end with one axis over n points: displacement gradients, first Piola-Kirchhoff stresses (9, n) and tangents
(9, 9, n) as in `fem.model.material`, symmetric tensors (6, n) in the order of `fem.model.viscoelasticity.PAIRS`. w
are the weights of the points.
"""

import numpy as np

from fem.model.viscoelasticity import PAIRS, PLACES
from geometry.compiled import compiled

_ROWS, _COLUMNS = np.array(PAIRS).T.copy()
_PLACES = np.asarray(PLACES)


@compiled
def add_dead_stress(G, H, w, W, P, A, tangent):
    """Add energy H : (C - 1) / 2, stress F H, and tangent delta_ik H_JL, times the weights."""
    n = len(w)
    weighted = np.empty((6, n))
    for a in range(6):
        row, own = weighted[a], H[a]
        for x in range(n):
            row[x] = w[x] * own[x]
    for i in range(3):
        for J in range(3):
            row, own = P[3 * i + J], weighted[_PLACES[i, J]]
            a, b, c = G[3 * i], G[3 * i + 1], G[3 * i + 2]
            first, second, third = weighted[_PLACES[0, J]], weighted[_PLACES[1, J]], weighted[_PLACES[2, J]]
            slope = G[3 * i + J]
            for x in range(n):
                force = a[x] * first[x] + b[x] * second[x] + c[x] * third[x]
                row[x] += own[x] + force
                W[x] += slope[x] * (own[x] + force / 2)
            if tangent:
                for L in range(3):
                    out, stress = A[3 * i + J, 3 * i + L], weighted[_PLACES[J, L]]
                    for x in range(n):
                        out[x] += stress[x]


@compiled
def _invert(X, out):
    """Write the inverse of a symmetric tensor (6,); return its determinant."""
    a, b, c, f, e, d = X[0], X[1], X[2], X[3], X[4], X[5]
    det = a * (b * c - f * f) - d * (d * c - f * e) + e * (d * f - b * e)
    out[0], out[1], out[2] = (b * c - f * f) / det, (a * c - e * e) / det, (a * b - d * d) / det
    out[3], out[4], out[5] = (d * e - a * f) / det, (d * f - b * e) / det, (e * f - c * d) / det
    return det


@compiled
def _sandwich(X, a, b):
    """Return an entry of (X_IK X_JL + X_IL X_JK) / 2, which maps dC to X dC X."""
    I, J, K, L = _ROWS[a], _COLUMNS[a], _ROWS[b], _COLUMNS[b]
    return (X[_PLACES[I, K]] * X[_PLACES[J, L]] + X[_PLACES[I, L]] * X[_PLACES[J, K]]) / 2


@compiled
def add_branch(G, Jm1, A0, b0, mu, w, W, P, A, tangent):
    """Add a branch of the law "finite", `fem.model.viscoelasticity.branch_stress`, with A0 (6, n), b0 and mu (n,).

    With X = A0 + b Cbar and Y = det(X)^(1/3) X^-1, dY = det(X)^(1/3) b (Xi (Xi : dCbar) / 3 - Xi dCbar Xi), where
    Xi = X^-1 and dCbar = J^(-2/3) (dC - C (C^-1 : dC) / 3). P_iJ gains F_iI S_IJ, and its tangent delta_ik S_JL +
    F_iI F_kK (2 dS/dC)_IJKL.
    """
    C, Ci, X, Xi, S, along = np.empty(6), np.empty(6), np.empty(6), np.empty(6), np.empty(6), np.empty(6)
    F, CC, inner, half = np.empty((3, 3)), np.empty((6, 6)), np.empty((6, 6)), np.empty((9, 6))
    for x in range(len(w)):
        for i in range(3):
            for J in range(3):
                F[i, J] = G[3 * i + J, x] + (1.0 if i == J else 0.0)
        for a in range(6):
            I, J = _ROWS[a], _COLUMNS[a]
            C[a] = F[0, I] * F[0, J] + F[1, I] * F[1, J] + F[2, I] * F[2, J]
        less, b = (1 + Jm1[x]) ** (-2 / 3), b0[x]
        _invert(C, Ci)
        for a in range(6):
            X[a] = A0[a, x] + b * less * C[a]
        root = _invert(X, Xi) ** (1 / 3)
        trace = 0.0
        for a in range(6):
            trace += (1.0 if a < 3 else 2.0) * root * Xi[a] * C[a]
        scale = w[x] * mu[x] * less
        W[x] += w[x] * mu[x] / 2 * (less * trace - 3)
        for a in range(6):
            S[a] = scale * (root * Xi[a] - trace / 3 * Ci[a])
        for i in range(3):
            for J in range(3):
                for I in range(3):
                    P[3 * i + J, x] += F[i, I] * S[_PLACES[I, J]]
        if not tangent:
            continue
        twice = 0.0
        for a in range(6):
            along[a] = 0.0
            for d in range(6):
                inner[a, d] = 2 * scale * less * root * b * (Xi[a] * Xi[d] / 3 - _sandwich(Xi, a, d))
                along[a] += inner[a, d] * (1.0 if d < 3 else 2.0) * C[d]
            twice += (1.0 if a < 3 else 2.0) * along[a] * C[a]
        for a in range(6):
            for d in range(6):
                CC[a, d] = (
                    inner[a, d]
                    - (along[a] * Ci[d] + Ci[a] * along[d]) / 3
                    + (twice / 9 - 2 / 9 * scale * trace) * Ci[a] * Ci[d]
                    + 2 / 3 * scale * trace * _sandwich(Ci, a, d)
                    - 2 / 3 * (Ci[a] * S[d] + S[a] * Ci[d])
                )
        for i in range(3):
            for J in range(3):
                for d in range(6):
                    half[3 * i + J, d] = 0.0
                    for I in range(3):
                        half[3 * i + J, d] += F[i, I] * CC[_PLACES[I, J], d]
        for e in range(9):
            for k in range(3):
                for L in range(3):
                    total = S[_PLACES[e % 3, L]] if e // 3 == k else 0.0
                    for K in range(3):
                        total += F[k, K] * half[e, _PLACES[K, L]]
                    A[e, 3 * k + L, x] += total
