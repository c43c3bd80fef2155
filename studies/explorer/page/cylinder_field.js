// Field of a cylinder magnet with uniform axial magnetisation: analytic/field/cylinder_pointwise.py in JavaScript.
// Points are in the magnet's frame, mm; z points along the magnetisation; B in T. Only the near form (two charged end
// faces by Bulirsch's integral) is here: up to 100 radii from the magnet its rounding error is below 1e-9 of |B|.
"use strict";

const CylinderField = (() => {
  const SETTLED = 1e-8;

  /** B_r/r and B_z of a disc of radius 1 and unit charge at a height zeta above it, without the step inside r = 1. */
  function face(r, gap, zeta) {
    const outer = 1 + r, S = zeta * zeta + outer * outer, Q = zeta * zeta + gap * gap;
    const s = Math.sqrt(S), m = (4 * r) / S;
    let k = Math.sqrt(Q) / s;
    let [p, q] = gap === 0 ? [1, 1] : [Math.abs(gap) / outer, Math.sign(gap)];
    let last = 1, mean = 1 + k, product = k, c = 1, inverse = 1 / p;
    [c, q] = [c + q * inverse, 2 * (q + c * k * inverse)];
    p += k * inverse;
    let term = 1 / (mean * mean), total = term / 2, share = 0.5, size = 2;
    while (Math.abs(last - k) > SETTLED * last) {
      last = mean;
      k = 2 * Math.sqrt(product);
      product = k * mean;
      inverse = 1 / p;
      const ratio = product * inverse;
      [c, q] = [c + q * inverse, 2 * (q + c * ratio)];
      p += ratio;
      mean += k;
      term = (term * m) / mean;
      term *= term;
      share *= 0.5;
      size *= 2;
      total += term * share;
    }
    const C = ((Math.PI / 2) * size / mean) * total;
    return [(4 * C) / (Math.PI * S * s), (-0.5 * zeta * (q + c * mean)) / (mean * (mean + p) * outer * s)];
  }

  /** B (3) at a point (x, y, z) of a magnet of this radius, height and polarisation; null on its rim. */
  function field(x, y, z, radius, height, J) {
    const r = Math.hypot(x, y) / radius, gap = 1 - r, half = height / 2;
    const up = (z - half) / radius, down = (z + half) / radius;
    if (gap === 0 && (up === 0 || down === 0)) return null;
    const [leanTop, alongTop] = face(r, gap, up), [leanBottom, alongBottom] = face(r, gap, down);
    // the charges give mu0 H, to which J is added inside; the steps of both faces and J are summed first
    const within = 0.5 * (Math.sign(gap) + 1), step = within * (Math.sign(down) - Math.sign(up));
    const lean = (J * (leanTop - leanBottom)) / radius;
    return [lean * x, lean * y, J * (step + alongTop - alongBottom)];
  }

  return { field };
})();
