// Prediction by a Gaussian process from its training points: studies/surrogate/gaussian_process.py in JavaScript.
"use strict";

const GaussianProcess = (() => {
  const ROOT5 = Math.sqrt(5);

  // Matrices are Float64Array, row by row.
  function correlation(a, b, at, from, count) {
    let square = 0;
    for (let i = 0; i < count; i++) square += (a[at + i] - b[from + i]) ** 2;
    const r = ROOT5 * Math.sqrt(square);
    return (1 + r * (1 + r / 3)) * Math.exp(-r);
  }

  /** Replace the lower triangle of a symmetric matrix (n, n) by its Cholesky factor. */
  function factorise(K, n) {
    for (let j = 0; j < n; j++) {
      for (let i = j; i < n; i++) {
        let sum = K[i * n + j];
        for (let k = 0; k < j; k++) sum -= K[i * n + k] * K[j * n + k];
        K[i * n + j] = i === j ? Math.sqrt(sum) : sum / K[j * n + j];
      }
    }
    return K;
  }

  /** Solve L x = b in place. */
  function forwardOne(L, n, b) {
    for (let i = 0; i < n; i++) {
      let sum = b[i];
      for (let k = 0, at = i * n; k < i; k++, at++) sum -= L[at] * b[k];
      b[i] = sum / L[i * n + i];
    }
    return b;
  }

  /** Solve L X = B in place for columns B (n, m). */
  function forward(L, n, B, m) {
    for (let i = 0; i < n; i++) {
      for (let k = 0; k < i; k++) {
        const l = L[i * n + k];
        for (let c = 0; c < m; c++) B[i * m + c] -= l * B[k * m + c];
      }
      for (let c = 0; c < m; c++) B[i * m + c] /= L[i * n + i];
    }
    return B;
  }

  /** Solve L^T X = B in place for columns B (n, m). */
  function backward(L, n, B, m) {
    for (let i = n - 1; i >= 0; i--) {
      for (let c = 0; c < m; c++) B[i * m + c] /= L[i * n + i];
      for (let k = 0; k < i; k++) {
        const l = L[i * n + k];
        for (let c = 0; c < m; c++) B[k * m + c] -= l * B[i * m + c];
      }
    }
    return B;
  }

  /** A^T B of matrices (n, p) and (n, q). */
  function product(A, B, n, p, q) {
    const result = new Float64Array(p * q);
    for (let i = 0; i < n; i++)
      for (let j = 0; j < p; j++) for (let k = 0; k < q; k++) result[j * q + k] += A[i * p + j] * B[i * q + k];
    return result;
  }

  /**
   * Condition a process on its training points: x (N, p), y (N, q), lengths (p), and the nugget.
   * The result's `predict(x)` returns {mean (q), spread}; the equations stand in the Python module.
   */
  function condition({ x, y, lengths, nugget }) {
    const p = lengths.length, n = x.length / p, q = y.length / n;
    const scaled = x.map((value, i) => value / lengths[i % p]);
    const L = new Float64Array(n * n);
    for (let i = 0; i < n; i++)
      for (let j = 0; j <= i; j++) L[i * n + j] = correlation(scaled, scaled, i * p, j * p, p) + (i === j ? nugget : 0);
    factorise(L, n);
    const H = new Float64Array(n * (p + 1));
    for (let i = 0; i < n; i++) {
      H[i * (p + 1)] = 1;
      for (let j = 0; j < p; j++) H[i * (p + 1) + j + 1] = x[i * p + j];
    }
    const whitened = forward(L, n, H.slice(), p + 1);
    const gram = factorise(product(whitened, whitened, n, p + 1, p + 1), p + 1);
    const trend = product(whitened, forward(L, n, y.slice(), q), n, p + 1, q);
    backward(gram, p + 1, forward(gram, p + 1, trend, q), q);
    const weights = y.slice();
    for (let i = 0; i < n; i++)
      for (let j = 0; j <= p; j++)
        for (let c = 0; c < q; c++) weights[i * q + c] -= H[i * (p + 1) + j] * trend[j * q + c];
    backward(L, n, forward(L, n, weights, q), q);

    function predict(point) {
      const k = new Float64Array(n), at = Float64Array.from(point, (value, i) => value / lengths[i]);
      for (let i = 0; i < n; i++) k[i] = correlation(at, scaled, 0, i * p, p);
      const mean = new Float64Array(q), u = Float64Array.of(1, ...point);
      for (let j = 0; j <= p; j++) for (let c = 0; c < q; c++) mean[c] += u[j] * trend[j * q + c];
      for (let i = 0; i < n; i++) for (let c = 0; c < q; c++) mean[c] += k[i] * weights[i * q + c];
      // the spread: 1 + nugget - v.v + u.u with v = L^-1 k and u = G^-1 (h - H^T K^-1 k)
      forwardOne(L, n, k);
      let square = 1 + nugget;
      for (let i = 0; i < n; i++) {
        square -= k[i] ** 2;
        for (let j = 0; j <= p; j++) u[j] -= whitened[i * (p + 1) + j] * k[i];
      }
      for (const value of forwardOne(gram, p + 1, u)) square += value ** 2;
      return { mean, spread: Math.sqrt(Math.max(square, nugget)) };
    }

    return { predict };
  }

  return { condition };
})();
