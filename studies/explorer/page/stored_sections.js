// The deformed section and the sensor in 3D from stored states of one design: studies/explorer/offline_sections.py.
// Lengths over D, pressures over E. For a design of other proportions the stored points are moved with its outline, and
// the displacement is corrected so that the magnet stands where the surrogate puts it; `note` says so.
"use strict";

const StoredSections = (() => {
  const SAME = 1e-6, SECTORS = 32, ARC = 7, FIELDS = 4;
  const round = (value, digits) => Math.round(value * 10 ** digits) / 10 ** digits;

  /** The place of a value between nodes: index and share, the share beyond 1 after the last node. */
  function place(nodes, value, last) {
    let i = 0;
    while (i < last - 1 && nodes[i + 1] < value) i++;
    return last === 0 ? [0, 0] : [i, (value - nodes[i]) / (nodes[i + 1] - nodes[i])];
  }

  /** Piecewise linear map through pairs (from, to) in rising order. */
  function mapped(value, from, to) {
    let i = 0;
    while (i < from.length - 2 && from[i + 1] < value) i++;
    return to[i] + ((value - from[i]) * (to[i + 1] - to[i])) / (from[i + 1] - from[i] || 1);
  }

  function load(data) {
    const { rest, triangles: flat, depths, shears, known, scale, values, design: stored } = data, n = rest.length / 2;
    const triangles = Array.from({ length: flat.length / 3 }, (_, k) => Array.from(flat.subarray(3 * k, 3 * k + 3)));
    const roots = depths.map(Math.sqrt);
    const half = n / 2;

    /** The four fields at all points: bilinear over the root of the depth and the shear. */
    function fieldsAt(depth, shear) {
      const first = shear > 0 ? 1 : 0, rows = depths.length - 1;
      let [i, s] = place(roots, Math.sqrt(depth), rows);
      if (i < first) [i, s] = [first, 0];
      const columns = shears.length - 1, [j, t] = shear > 0 ? place(shears, shear, columns) : [0, 0];
      const corners = [[i, j, (1 - s) * (1 - t)], [i + 1, j, s * (1 - t)], [i, j + 1, (1 - s) * t], [i + 1, j + 1, s * t]];
      const used = corners.filter(([, , weight]) => Math.abs(weight) > 1e-12), inside = s <= 1 + SAME && t <= 1 + SAME;
      const present = used.every(([a, b]) => known[a]?.[b]);
      // where a stored path stopped early, the last state before it stands in
      const taken = present ? used : [[...nearest(i, j), 1]];
      const result = new Float64Array(FIELDS * n);
      for (const [a, b, weight] of taken) {
        const start = (a * shears.length + b) * FIELDS * n;
        for (let f = 0; f < FIELDS; f++)
          for (let k = 0; k < n; k++) result[f * n + k] += weight * scale[f] * values[start + f * n + k];
      }
      return { fields: result, exact: present && inside };
    }

    function nearest(i, j) {
      for (let a = i; a >= 0; a--) for (let b = j; b >= 0; b--) if (known[a][b]) return [a, b];
      return [0, 0];
    }

    const proportions = ({ D, L, magnet_diameter: d, magnet_height: h, nu }) => ({
      L: L / D, magnet_diameter: d / D, magnet_height: h / D, nu,
    });

    /** Points of the template in a design of other proportions, over D. */
    function shaped(own) {
      const [H0, H] = [stored.L - 0.5, own.L - 0.5], [a0, a] = [stored.magnet_diameter / 2, own.magnet_diameter / 2];
      const [b0, b] = [stored.magnet_height / 2, own.magnet_height / 2];
      const from = [0, H0 - b0, H0 + b0, stored.L], to = [0, H - b, H + b, own.L];
      return Float64Array.from({ length: 2 * n }, (_, k) => {
        const x = rest[k - (k % 2)], z = rest[k - (k % 2) + 1], height = mapped(z, from, to);
        if (k % 2) return height;
        // the outline before and after gives the width at the height; the magnet's radius is kept within it
        const width = (v, top, centre) => (v > centre ? Math.sqrt(Math.max(0.25 - (v - centre) ** 2, 0)) : 0.5);
        const w0 = width(z, stored.L, H0), w = width(height, own.L, H), size = Math.abs(x);
        if (w0 < 1e-9) return 0;
        const beside = Math.abs(z - H0) <= b0 + 1e-9 && a0 < w0 && a < w;
        return Math.sign(x) * (beside ? mapped(size, [0, a0, w0], [0, a, w]) : (size * w) / w0);
      });
    }

    /** The section of a state: the part `section`, and a note where it is no interpolation of this design's states. */
    function section(design, { load: one, pose }) {
      const { D, E } = design, own = proportions(design), sheared = one.shearsTip;
      const same = Object.keys(own).every((key) => Math.abs(own[key] - stored[key]) < SAME);
      const { fields, exact } = fieldsAt(one.depth / D, sheared ? one.shear / D : 0);
      const points = same ? rest : shaped(own), [c, s] = sheared ? direction(one) : [1, 0], way = sheared ? side(one) : 1;
      const mirror = (k) => (way > 0 ? k : (k + half) % n), H = own.L - 0.5, b = own.magnet_height / 2;
      // the stored motion of the magnet's wall against that of the surrogate; all along the shear, and mirrored at last
      const target = { u: pose.u / D, w: pose.w / D, t: pose.t }, motion = rigidMotion(fields, points, own);
      const away = { u: target.u - motion.u, w: target.w - motion.w, t: target.t - motion.t };
      const moved = [], restPoints = [], displacement = [], pressure = [], stretch = [];
      for (let k = 0; k < n; k++) {
        const m = mirror(k), x = points[2 * k], z = points[2 * k + 1], xm = way * x;
        const share = z < H - b ? z / (H - b) : z > H + b ? (own.L - z) / (own.L - H - b) : 1;
        const ux = way * (fields[m] + share * (away.u + (z - H) * away.t)), uz = fields[n + m] + share * (away.w - xm * away.t);
        restPoints.push([round(D * x, 4), round(D * z, 4)]);
        moved.push([round(D * (x + ux), 4), round(D * (z + uz), 4)]);
        displacement.push(round(D * Math.hypot(ux, uz), 4));
        pressure.push(E * fields[2 * n + m]);
        stretch.push(round(fields[3 * n + m], 4));
      }
      const along = sheared ? way * one.shear : 0;
      return {
        section: {
          points: moved, rest: restPoints, triangles, fields: { displacement, pressure, stretch },
          magnet: outline(design, way * pose.u, pose.w, way * pose.t),
          plate: { z: design.L - one.depth, tilt: 0, x: along }, direction: [way * c, way * s],
        },
        note: note(same, exact),
      };
    }

    function note(same, exact) {
      const texts = [];
      if (!same)
        texts.push(
          `The picture is the stored one of L/D = ${stored.L.toPrecision(4)} with a magnet of ` +
          `${stored.magnet_diameter.toPrecision(3)} x ${stored.magnet_height.toPrecision(3)} D and nu = ${stored.nu}, ` +
          "fitted to this design: its colours are approximate.");
      if (!exact) texts.push("The picture lies beyond the stored states: it is approximate.");
      return texts.join(" ");
    }

    const direction = ({ shear_x: x, shear_y: y, shear }) => [x / shear, y / shear];
    /** 1 or -1: sections are drawn along the direction with x > 0, or along y. */
    const side = ({ shear_x: x, shear_y: y }) => Math.sign(x || y);

    /** Shift and tilt of the magnet's wall in the stored field, by least squares over its points. */
    function rigidMotion(fields, points, own) {
      const H = own.L - 0.5, a = own.magnet_diameter / 2, b = own.magnet_height / 2, near = [];
      for (let k = 0; k < n; k++)
        if (Math.abs(points[2 * k]) <= a + 1e-3 && Math.abs(points[2 * k + 1] - H) <= b + 1e-3) near.push(k);
      if (near.length < 2) return { u: 0, w: 0, t: 0 };
      const mean = (f) => near.reduce((sum, k) => sum + f(k), 0) / near.length, x = (k) => points[2 * k], z = (k) => points[2 * k + 1] - H;
      const [mx, mz, mu, mw] = [mean(x), mean(z), mean((k) => fields[k]), mean((k) => fields[n + k])];
      const cross = mean((k) => (z(k) - mz) * (fields[k] - mu) - (x(k) - mx) * (fields[n + k] - mw));
      const size = mean((k) => (z(k) - mz) ** 2 + (x(k) - mx) ** 2), t = cross / size;
      return { u: mu - t * mz, w: mw + t * mx, t };
    }

    /** The magnet's outline in the plane of the section, mm. */
    function outline(design, u, w, t) {
      const a = design.magnet_diameter / 2, b = design.magnet_height / 2, rho = design.magnet_edge_radius, steps = rho ? ARC : 1;
      const corners = [[1, 1, 0], [-1, 1, Math.PI / 2], [-1, -1, Math.PI], [1, -1, (3 * Math.PI) / 2]], c = Math.cos(t), s = Math.sin(t);
      return corners.flatMap(([i, j, start]) => Array.from({ length: steps }, (_, k) => {
        const angle = start + (steps > 1 ? (k * Math.PI) / 2 / (steps - 1) : 0);
        const x = i * (a - rho) + rho * Math.cos(angle), z = j * (b - rho) + rho * Math.sin(angle);
        return [round(c * x + s * z + u, 4), round(c * z - s * x + w + design.L - design.D / 2, 4)];
      }));
    }

    /** The part `sensor3d`: the section's outline swept round the axis, with the orders 0 and 1 of the angle. */
    function surface({ points, rest: still, direction: [c, s], fields }) {
      const { skin, pocket } = pocketAndSkin(), turns = Array.from({ length: SECTORS + 1 }, (_, k) => (Math.PI * k) / SECTORS);
      const swept = ({ used, faces }, signs) => {
        const result = { points: [], value: [], triangles: [] };
        for (const sign of signs) {
          const start = result.value.length;
          for (const turn of turns) {
            const e = Math.cos(turn), f = sign * Math.sin(turn);
            for (const k of used) {
              // lateral and radial motion, sinking and lean, from both sides of the section
              const right = points[k][0] - still[k][0], left = points[k + half][0] - still[k + half][0];
              const down = points[k][1] - still[k][1], up = points[k + half][1] - still[k + half][1];
              const lateral = (right + left) / 2, radial = (right - left) / 2, rise = (down + up) / 2 + ((down - up) / 2) * e;
              const x = still[k][0] * e + lateral + radial * e, y = (still[k][0] + radial) * f;
              result.points.push(c * x - s * y, s * x + c * y, still[k][1] + rise);
              result.value.push(Math.hypot(lateral + radial * e, radial * f, rise));
            }
          }
          for (const at of sign > 0 ? faces : faces.slice().reverse()) result.triangles.push(at + start);
        }
        return result;
      };
      const cut = { points: points.flatMap(([x, z]) => [c * x, s * x, z]), value: fields.displacement.slice(), triangles: triangles.flat() };
      const parts = { back: swept(skin, [1]), front: swept(skin, [-1]), cut, magnet: swept(pocket, [1, -1]) };
      return { parts, largest: Object.values(parts).reduce((most, { value }) => value.reduce((a, b) => Math.max(a, b), most), 0) };
    }

    let outlines = null;
    /** The outline of the right half, swept: skin and the magnet's pocket, with the points they use and triangles. */
    function pocketAndSkin() {
      if (outlines) return outlines;
      const number = new Map();
      for (const cell of triangles.filter(([i]) => i < half))
        for (let k = 0; k < 3; k++) {
          const pair = [cell[k], cell[(k + 1) % 3]], key = Math.min(...pair) * n + Math.max(...pair);
          number.set(key, number.has(key) ? null : pair);
        }
      const edges = [...number.values()].filter((pair) => pair && pair.some((k) => rest[2 * k] > 1e-9));
      const H = stored.L - 0.5, a = stored.magnet_diameter / 2 + 1e-3, b = stored.magnet_height / 2 + 1e-3;
      const inner = (pair) => pair.every((k) => rest[2 * k] <= a && Math.abs(rest[2 * k + 1] - H) <= b);
      outlines = { pocket: sweep(edges.filter(inner)), skin: sweep(edges.filter((pair) => !inner(pair))) };
      return outlines;
    }

    function sweep(edges) {
      const used = [...new Set(edges.flat())], row = new Map(used.map((k, i) => [k, i])), next = used.length, faces = [];
      for (let step = 0; step < SECTORS; step++)
        for (const [one, other] of edges) {
          const i = step * next + row.get(one), j = step * next + row.get(other);
          faces.push(i, j, j + next, i, j + next, i + next);
        }
      return { used, faces };
    }

    return { section, surface };
  }

  return { load };
})();
