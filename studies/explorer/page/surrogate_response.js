// Responses of beams by the surrogate: studies/surrogate/prediction.py and surrogate_range.py in JavaScript.
// Lengths are over D, forces over E D^2, tilts in rad. A quantity is {value, halfWidth}, the half width of its 90 %
// interval.
"use strict";

const SurrogateResponse = (() => {
  const SHEAR = ["force_x", "force_z", "shift_x", "shift_z", "tilt", "contact_radius", "strain"];
  const general = PythonText.general;

  /** The polynomial through values at nodes, by Lagrange's formula in its barycentric form. */
  function interpolated(values, nodes, weights, at) {
    let above = 0, below = 0;
    for (let j = 0; j < nodes.length; j++) {
      const distance = at - nodes[j];
      if (distance === 0) return values[j];
      above += (weights[j] / distance) * values[j];
      below += weights[j] / distance;
    }
    return above / below;
  }

  function barycentricWeights(nodes) {
    return nodes.map((node, j) => 1 / nodes.reduce((all, other, k) => (k === j ? all : all * (node - other)), 1));
  }

  /** Values at nodes, interpolated linearly and constant beyond the nodes. */
  function linear(values, nodes, at) {
    const inner = Math.min(Math.max(at, nodes[0]), nodes[nodes.length - 1]);
    let right = 1;
    while (right < nodes.length - 1 && nodes[right] < inner) right++;
    const share = (inner - nodes[right - 1]) / (nodes[right] - nodes[right - 1]);
    return values[right - 1] * (1 - share) + values[right] * share;
  }

  /** Return `beam(L, diameter, height, nu, edge)` of the surrogate whose groups and range are `data`. */
  function load(data) {
    const { range, calibration } = data;
    const processes = Object.fromEntries(
      Object.entries(data.groups).map(([name, group]) => [name, GaussianProcess.condition(group)]),
    );
    const rootNodes = Array.from({ length: range.press_nodes }, (_, j) =>
      (Math.cos(Math.PI * (1 - j / (range.press_nodes - 1))) + 1) / 2);
    const rootWeights = barycentricWeights(rootNodes);
    const squares = range.shear_nodes.map((node) => node ** 2);
    const squareWeights = barycentricWeights(squares);

    /** Outputs at the nodes and their relative half widths, by quantity. */
    function atNodes(name, point, region) {
      const group = data.groups[name], { mean, spread } = processes[name].predict(point), result = {};
      group.quantities.forEach((quantity, i) => {
        const rows = group.quantiles[quantity], count = group.nodes;
        result[quantity] = {
          values: Array.from(mean.subarray(i * count, (i + 1) * count)),
          widths: Array.from({ length: count }, (_, k) => spread * rows[region * count + k]),
        };
      });
      return result;
    }

    function beam(L, diameter, height, nu, edge) {
      const below = L - 0.5 - height / 2;
      const features = [Math.log(L), diameter, height, Math.sqrt(1 - 2 * nu), edge, Math.log(Math.max(below, 1e-3))];
      const kind = height > calibration.thick ? 2 : diameter > calibration.wide ? 4 : 0;
      const region = (L > calibration.slender ? 1 : 0) + kind;
      const over = Math.min(Math.max((diameter - 0.5) / (range.diameter[1] - 0.5), 0), 1);
      const share = range.depth_share + (range.widest_share - range.depth_share) * over;
      const deepest = Math.min(range.deepest, share * (L - height));
      const farthest = Math.min(range.farthest, range.shear_share * L);
      const low = Math.sqrt(range.shallowest), high = Math.sqrt(deepest);
      const presses = { ...atNodes("press", features, region), ...atNodes("strain", features, region) };
      const skinShears = new Map();

      function atRoot(name, share) {
        return interpolated(presses[name].values, rootNodes, rootWeights, share);
      }

      /** The response to a frictionless press; the shift is positive down. */
      function press(depth) {
        const share = (Math.sqrt(depth) - low) / (high - low), result = {};
        for (const [name, { widths }] of Object.entries(presses)) {
          const form = Math.exp(atRoot(name, share)), relative = linear(widths, rootNodes, share);
          const unit = { force: depth ** 1.5, shift: depth, contact_radius: Math.sqrt(depth / 2) }[name] ?? 1;
          const value = name === "sideways_ratio" ? 1 - form : unit * form;
          result[name] = { value, halfWidth: relative * (name === "sideways_ratio" ? form : unit * form) };
        }
        return result;
      }

      /** Forms of shears at a depth, at the shear's nodes. */
      function sheared(depth) {
        if (!skinShears.has(depth)) {
          const point = [...features, Math.sqrt(depth)], place = region + (depth > calibration.deep ? calibration.regions : 0);
          if (skinShears.size > 64) skinShears.clear();
          skinShears.set(depth, { ...atNodes("shear", point, place), ...atNodes("shear_skin", point, place) });
        }
        return skinShears.get(depth);
      }

      /** The response to a glued shear after a press, along the shear. */
      function shear(depth, s) {
        const parts = sheared(depth), pressed = press(depth), root = s / farthest, form = {};
        for (const name of SHEAR) form[name] = interpolated(parts[name].values, squares, squareWeights, root ** 2);
        const compliance = (64 * L ** 3) / (3 * Math.PI) + (12 * L) / (0.9 * Math.PI);
        const value = {
          force_x: (s * form.force_x) / compliance,
          force_z: pressed.force.value - s ** 2 * Math.exp(form.force_z),
          shift_x: s * form.shift_x,
          shift_z: pressed.shift.value + s ** 2 * form.shift_z,
          tilt: s * form.tilt,
          contact_radius: Math.exp(form.contact_radius) * Math.sqrt(depth / 2),
          strain: Math.exp(form.strain),
        };
        const force = Math.hypot(value.force_x, value.force_z), shift = Math.hypot(value.shift_x, value.shift_z);
        const rod = { force_x: force, force_z: force, shift_x: shift, shift_z: shift };
        return Object.fromEntries(SHEAR.map((name) => {
          const relative = linear(parts[name].widths, range.shear_nodes, root);
          return [name, { value: value[name], halfWidth: (rod[name] ?? Math.abs(value[name])) * relative }];
        }));
      }

      /** The depth at which a measure of the sideways stiffness, `stiffnessAt(share of the depths)`, falls to 0. */
      function firstZero(stiffnessAt) {
        const count = calibration.critical_grid;
        let last = null;
        for (let k = 0; k < count; k++) {
          const share = k / (count - 1), depth = (low + (high - low) * share) ** 2;
          const stiffness = stiffnessAt(share);
          if (stiffness <= 0) {
            const before = last ?? { depth, stiffness };
            const part = before.stiffness > stiffness ? before.stiffness / (before.stiffness - stiffness) : 0;
            return before.depth + part * (depth - before.depth);
          }
          last = { depth, stiffness };
        }
        return Infinity;
      }

      /** The depth at which a frictionless press buckles sideways; infinite and without a half width if not in the range. */
      function criticalDepth() {
        const { widths } = presses.sideways_ratio, value = firstZero((share) => -atRoot("sideways_ratio", share));
        const rule = data.groups.strain.quantiles.critical_depth[region];
        const spread = widths.reduce((sum, width) => sum + width, 0) / widths.length;
        return { value, halfWidth: value < Infinity ? value * rule * spread : NaN };
      }

      /** The depth to which a press is known to stay stable. */
      function stableTo() {
        const { widths } = presses.sideways_ratio, { value, halfWidth } = criticalDepth();
        const least = (share) => 1 - Math.exp(atRoot("sideways_ratio", share)) * (1 + linear(widths, rootNodes, share));
        return Math.min(Number.isFinite(halfWidth) ? value - halfWidth : firstZero(least), deepest);
      }

      /** The lowest natural frequency over (E / rho)^(1/2) / D; null where the density ratio lies outside the range. */
      function firstMode(ratio) {
        if (!(ratio >= range.density_ratio[0] && ratio <= range.density_ratio[1])) return null;
        const { values, widths } = atNodes("mode", [...features, Math.log(ratio)], region).frequency;
        const value = Math.exp(values[0]);
        return { value, halfWidth: value * widths[0] };
      }

      return { deepest, farthest, stable: stableTo(), press, shear, criticalDepth, firstMode };
    }

    /** Why the surrogate refuses a beam, "" if it takes it; the sentence of `Beams.outside`. */
    function outside(L, diameter, height, nu, edge) {
      const a = diameter / 2, b = height / 2, smaller = Math.min(diameter, height), rho = edge * smaller;
      const wall = Math.min(0.5 - Math.hypot(a - rho, b - rho) - rho, 0.5 - a, L - 0.5 - b);
      const checks = [
        ["L/D", L, range.length],
        ["magnet_diameter/D", diameter, range.diameter],
        ["magnet_height/D", height, range.height],
        ["nu", nu, range.poisson],
        ["the radius of the magnet's edges", rho, [0, range.edge[1] * smaller]],
        ["silicone below the magnet of", L - 0.5 - b, [range.least_below, Infinity]],
        ["silicone around the magnet of", wall, [range.least_wall, Infinity]],
      ];
      for (const [text, value, [least, most]] of checks) {
        if (value >= least - 1e-9 && value <= most + 1e-9) continue;
        const bound = most === Infinity ? `at least ${general(least)}` : `within ${general(least)} and ${general(most, 4)}`;
        return `the surrogate knows beams with ${text} ${bound}; got ${general(value, 4)}`;
      }
      return "";
    }

    return { beam, outside, range };
  }

  return { load };
})();
