// What the page without a server computes for a state: studies/explorer/offline_model.py in JavaScript, where the
// definitions stand. Units mm, N, MPa, T, V, rad; tilts leave in degrees.
"use strict";

const OfflineModel = (() => {
  const LEVEL = "surrogate", STEP = 4e-3, FIELD_STEP = 1e-4, SINGULAR = 1e-4, CURVE_POINTS = 25;
  const PLANE = ["shift_x", "shift_z", "tilt", "force_x", "force_z"], ODD = [-1, 1, -1, -1, 1];
  const DEGREES = 180 / Math.PI;
  const general = PythonText.general;
  const scaleOf = ({ D, E }) => [D, -D, 1, E * D ** 2, E * D ** 2];
  const multiply = (A, B) => A.map((row) => B[0].map((_, j) => row.reduce((sum, v, k) => sum + v * B[k][j], 0)));
  const apply = (A, v) => A.map((row) => row.reduce((sum, a, k) => sum + a * v[k], 0));
  const absolute = (A) => A.map((row) => row.map(Math.abs));
  const finite = (value) => (Number.isFinite(value) ? value : null);

  function determinant([a, b, c]) {
    return a[0] * (b[1] * c[2] - b[2] * c[1]) - a[1] * (b[0] * c[2] - b[2] * c[0]) + a[2] * (b[0] * c[1] - b[1] * c[0]);
  }

  function inverse(M) {
    const det = determinant(M), next = (i) => (i + 1) % 3, last = (i) => (i + 2) % 3;
    return [0, 1, 2].map((i) => [0, 1, 2].map((j) =>
      (M[next(j)][next(i)] * M[last(j)][last(i)] - M[next(j)][last(i)] * M[last(j)][next(i)]) / det));
  }

  /** Return the model of a page from its decoded data. */
  function load({ fields, limits, surrogate, formulas, hall, lines }) {
    const model = SurrogateResponse.load(surrogate), beamFormulas = BeamFormulas.withConstants(formulas);
    const { range } = surrogate;
    let lastBeam = null;

    /** The design, load and formula level of a request's state, checked. */
    function checked({ preset = "paper", design = {}, load: motion = {}, magnet = "rigid", level = "standard" }, formulaLevel = "paper") {
      const values = Object.fromEntries(fields.map((spec) => [spec.name, design[spec.name] ?? spec.default]));
      return {
        preset, magnet, level, formulaLevel, motion,
        design: InputChecks.design(values, fields, limits), load: InputChecks.load(motion, limits.steepest),
      };
    }

    const overD = ({ D, L, magnet_diameter: d, magnet_height: h, nu, magnet_edge_radius: rho }) => {
      const [diameter, height] = [d / D, h / D];
      return [L / D, diameter, height, nu, rho / D / Math.min(diameter, height)];
    };

    /** The beam of a design, kept while its numbers stay. */
    function beamOf(design) {
      const numbers = overD(design), key = numbers.join();
      if (lastBeam?.key !== key) lastBeam = { key, beam: model.beam(...numbers) };
      return lastBeam.beam;
    }

    /** Why the surrogate refuses a case, "" if it takes it: surrogate_response.refusal. */
    function refusal(design, one, magnet) {
      if (design.law !== "neo-hookean") return `the surrogate knows the law neo-hookean only; got ${design.law}`;
      if (!(design.magnet_diameter > 0) || magnet === "ignored") return "the surrogate knows beams with a rigid magnet only";
      if (one.coulomb !== null) return "the surrogate does not know Coulomb friction";
      if (one.plate_tilt) return "the surrogate does not know tilted plates";
      const reason = model.outside(...overD(design));
      if (reason) return reason;
      const { D } = design, beam = beamOf(design), { depth, shear, shearsTip } = one;
      const least = shearsTip ? range.shallowest_shear : range.shallowest;
      if (!(depth / D >= least - 1e-9 && depth / D <= beam.deepest + 1e-9))
        return `the surrogate knows depths of ${general(least * D, 3)} to ${general(beam.deepest * D, 3)} mm here; ` +
          `got ${general(depth)} mm`;
      if (shearsTip && !(shear / D <= beam.farthest + 1e-9))
        return `the surrogate knows shears to ${general(beam.farthest * D, 3)} mm here; got ${general(shear)} mm`;
      if (!(depth / D <= beam.stable + 1e-9))
        return `the surrogate knows a press to stay stable to ${general(beam.stable * D, 3)} mm here, and nothing deeper; ` +
          `got ${general(depth)} mm`;
      return "";
    }

    /** Response and half widths in the plane of the shear, in the order of PLANE. */
    function planeOf(design, one) {
      const { D } = design, beam = beamOf(design), scale = scaleOf(design), sheared = one.shearsTip;
      const q = sheared ? beam.shear(one.depth / D, one.shear / D) : beam.press(one.depth / D), none = { value: 0, halfWidth: 0 };
      const parts = sheared ? PLANE.map((name) => q[name]) : [none, q.shift, none, none, q.force];
      return {
        value: parts.map(({ value }, i) => scale[i] * value),
        halfWidth: parts.map(({ halfWidth }, i) => Math.abs(scale[i]) * halfWidth),
        azimuth: sheared ? Math.atan2(one.shear_y, one.shear_x) : 0, shear: sheared ? one.shear : 0,
        contact: [D * q.contact_radius.value, D * q.contact_radius.halfWidth], strain: [q.strain.value, q.strain.halfWidth],
      };
    }

    function solve({ design, load: one, magnet }) {
      InputChecks.checkLoad(design, one, magnet);
      const reason = refusal(design, one, magnet);
      if (reason) throw new BadInput(`${reason}: take finite elements`);
      const plane = planeOf(design, one), [u, w, t, tangential, normal] = plane.value;
      const [c, s] = one.shearsTip ? [one.shear_x / one.shear, one.shear_y / one.shear] : [1, 0];
      const response = {
        force: [c * tangential, s * tangential, normal], shift: [c * u, s * u, w], tilt: c * t, tilt_y: s * t,
        contact_radius: plane.contact[0],
      };
      return { response, plane };
    }

    function statePart(state) {
      const { design, load: one } = state, { response, plane } = solve(state);
      const [u, w, t, tangential, normal] = plane.halfWidth;
      const c = Math.abs(Math.cos(plane.azimuth)), s = Math.abs(Math.sin(plane.azimuth));
      return {
        status: "ok", message: "", model: LEVEL,
        load: { depth: one.depth, shear: one.shearsTip ? [one.shear_x, one.shear_y] : [0, 0] },
        response: { ...response, tilt: response.tilt * DEGREES, tilt_y: response.tilt_y * DEGREES },
        estimates: {
          force: [c * tangential, s * tangential, normal], shift: [c * u, s * u, w], tilt: t * DEGREES,
          contact_radius: plane.contact[1], strain: plane.strain[1],
        },
        strain: plane.strain[0],
        readings: readingsPart(design, response, plane),
        decoded: decodedPart(design, one, response, plane),
        formula: formulaPart(design, one, "paper"),
        formula_level: { level: state.formulaLevel, ...formulaPart(design, one, state.formulaLevel) },
      };
    }

    function formulaPart(design, one, level) {
      try {
        const { force, shift, tilt, tilt_y: lean, contact_radius } = beamFormulas.solve(design, one, level);
        return { force, shift, tilt: tilt * DEGREES, tilt_y: lean * DEGREES, contact_radius, message: beamFormulas.outside(design, one, level) };
      } catch (error) {
        if (!(error instanceof BadInput)) throw error;
        return { force: null, shift: null, message: error.message };
      }
    }

    const poseOf = ({ shift, tilt, tilt_y: lean }) => ({ shift, tilt: [-lean, tilt] });
    const REST = { shift: [0, 0, 0], tilt: [0, 0] };
    const fieldsAt = (chosen, design, pose) => HallReadings.fields(chosen, design, pose, hall.poles);

    function readingsPart(design, response, plane) {
      const chosen = HallReadings.elements(design, hall);
      const now = fieldsAt(chosen, design, poseOf(response)).map((b, i) => HallReadings.output(chosen[i], b));
      const rest = fieldsAt(chosen, design, REST).map((b, i) => HallReadings.output(chosen[i], b));
      const widths = apply(absolute(fieldSlopes(design, plane)), plane.halfWidth.slice(0, 3));
      return {
        elements: chosen.map(({ name }) => name), units: chosen.map(({ unit }) => unit),
        volts: now.map(({ value }) => value), rest: rest.map(({ value }) => value),
        half_width: now.map(({ saturated }, i) => (saturated ? 0 : chosen[i].gain * widths[i])),
        noise: chosen.map((element) => HallReadings.noiseOf(element) * element.gain),
        saturated: now.map(({ saturated }) => saturated),
        low: chosen.map(({ low }) => low), high: chosen.map(({ high }) => high),
      };
    }

    /** Slopes of B.n along u, w and t, T/mm and T/rad. */
    function fieldSlopes(design, plane) {
      const chosen = HallReadings.elements(design, hall), c = Math.cos(plane.azimuth), s = Math.sin(plane.azimuth);
      const columns = [STEP * design.D, STEP * design.D, STEP].map((step, k) => {
        const [one, other] = [step, -step].map((off) => {
          const [u, w, t] = plane.value.slice(0, 3).map((v, i) => (i === k ? v + off : v));
          return fieldsAt(chosen, design, { shift: [c * u, s * u, w], tilt: [-s * t, c * t] });
        });
        return one.map((v, i) => (v - other[i]) / (2 * step));
      });
      return [0, 1, 2].map((i) => columns.map((column) => column[i]));
    }

    /** Pose and force with their slopes along depth, shear x and shear y: offline_model._loaded. */
    function loaded(design, one, plane) {
      const { D } = design, beam = beamOf(design), scale = scaleOf(design);
      const at = (depth, shear) => {
        const q = beam.shear(depth, Math.abs(shear));
        return PLANE.map((name, i) => scale[i] * q[name].value * (shear < 0 ? ODD[i] : 1));
      };
      const d = Math.min(one.depth / D, beam.stable), s = Math.min(plane.shear / D, beam.farthest);
      const low = Math.max(d - STEP, range.shallowest_shear), high = Math.min(d + STEP, beam.stable);
      const near = s - STEP, far = Math.min(s + STEP, beam.farthest);
      const difference = (a, b, width) => a.map((v, i) => (v - b[i]) / (width * D));
      const alongDepth = difference(at(high, s), at(low, s), high - low);
      const alongShear = difference(at(d, far), at(d, near), far - near);
      const value = plane.shear ? plane.value : at(d, 0);
      const ratio = plane.shear ? value.map((v) => v / plane.shear) : alongShear;
      const c = Math.cos(plane.azimuth), e = Math.sin(plane.azimuth);
      // the vector of a lateral and a vertical column, and its slopes along depth, shear x and shear y
      const vectors = (lateral, vertical) => {
        const vector = (v) => [v[lateral] * c, v[lateral] * e, vertical === null ? 0 : v[vertical]];
        const along = vector(alongShear), across = [-ratio[lateral] * e, ratio[lateral] * c, 0], depth = vector(alongDepth);
        const slopes = [0, 1, 2].map((i) => [depth[i], c * along[i] - e * across[i], e * along[i] + c * across[i]]);
        return [vector(value), slopes];
      };
      const [shift, shiftSlopes] = vectors(0, 1), [lean, leanSlopes] = vectors(2, null), [, forceSlopes] = vectors(3, 4);
      return {
        shift, shiftSlopes, forceSlopes, tilt: [-lean[1], lean[0]],
        tiltSlopes: [leanSlopes[1].map((v) => -v), leanSlopes[0]],
      };
    }

    /** Slopes of B.n along depth, shear x and shear y, T/mm: analytic.force_resolution.reading_slopes. */
    function readingSlopes(design, chosen, { shift, shiftSlopes, tilt, tiltSlopes }) {
      const half = FIELD_STEP * design.D;
      const columns = [0, 1, 2].map((k) => {
        const [one, other] = [half, -half].map((off) => fieldsAt(chosen, design, {
          shift: shift.map((v, i) => v + off * shiftSlopes[i][k]), tilt: tilt.map((v, i) => v + off * tiltSlopes[i][k]),
        }));
        return one.map((v, i) => (v - other[i]) / (2 * half));
      });
      return [0, 1, 2].map((i) => columns.map((column) => column[i]));
    }

    function decodedPart(design, one, response, plane) {
      const chosen = HallReadings.withNoise(HallReadings.elements(design, hall), hall);
      const field = fieldsAt(chosen, design, poseOf(response)), outputs = field.map((b, i) => HallReadings.output(chosen[i], b));
      const none = { level: LEVEL, force: null, half_width: null, noise: null };
      if (outputs.some(({ saturated }) => saturated)) return { status: "saturated", ...none };
      if (one.depth < range.shallowest_shear * design.D) return { status: "out_of_workspace", ...none };
      const state = loaded(design, one, plane), J = readingSlopes(design, chosen, state);
      const lengths = [0, 1, 2].map((k) => Math.hypot(J[0][k], J[1][k], J[2][k]));
      if (!(Math.abs(determinant(J.map((row) => row.map((v, k) => v / lengths[k])))) > SINGULAR))
        return { status: "ambiguous", ...none };
      const off = outputs.map(({ value }, i) => (value - chosen[i].rest) / chosen[i].gain - field[i]);
      const through = multiply(state.forceSlopes, inverse(J)), moved = apply(through, off);
      const c = Math.abs(Math.cos(plane.azimuth)), s = Math.abs(Math.sin(plane.azimuth));
      const [, , , tangential, normal] = plane.halfWidth, own = [c * tangential, s * tangential, normal];
      const carried = apply(absolute(multiply(through, fieldSlopes(design, plane))), plane.halfWidth.slice(0, 3));
      const noise = chosen.map(HallReadings.noiseOf);
      return {
        status: "ok", level: LEVEL, force: response.force.map((v, i) => v + moved[i]),
        half_width: own.map((v, i) => v + carried[i]),
        noise: through.map((row) => Math.hypot(...row.map((v, i) => v * noise[i]))),
      };
    }

    function curvePart({ design, magnet, formulaLevel }) {
      const rest = { depth: range.shallowest * design.D, friction: "none", plate_tilt: 0, coulomb: null, shear: 0, shearsTip: false };
      const reason = refusal(design, rest, magnet);
      if (reason) throw new BadInput(`${reason}: take finite elements`);
      const { D } = design, beam = beamOf(design), unit = design.E * D ** 2, low = range.shallowest * D, high = beam.stable * D;
      const depth = Array.from({ length: CURVE_POINTS }, (_, k) => low + ((high - low) * k) / (CURVE_POINTS - 1));
      const press = depth.map((d) => beam.press(Math.min(d / D, beam.stable)));
      const formula = (level) => {
        const answers = depth.map((d) => formulaPart(design, { ...rest, depth: d, shear_x: 0, shear_y: 0 }, level));
        return Object.fromEntries(["force", "shift"].map((name) => [name, answers.map((a) => a[name]?.[2] ?? null)]));
      };
      return {
        depth, force: press.map(({ force }) => unit * force.value), shift: press.map(({ shift }) => -D * shift.value),
        estimates: {
          force: press.map(({ force }) => unit * force.halfWidth), shift: press.map(({ shift }) => D * shift.halfWidth),
        },
        paper: formula("paper"), level: { name: formulaLevel, ...formula(formulaLevel) },
      };
    }

    /** Field lines in the plane of the section: offline_model.field_lines_part. */
    function fieldLinesPart(state) {
      const { design, load: one } = state, { plane } = solve(state), { D } = design;
      const way = !plane.shear || (one.shear_x || one.shear_y) > 0 ? 1 : -1;
      const u = way * plane.value[0], w = plane.value[1], t = way * plane.value[2];
      const a = design.magnet_diameter / 2, b = design.magnet_height / 2, centre = [u, design.L - D / 2 + w];
      const along = [Math.sin(t), Math.cos(t)], across = [Math.cos(t), -Math.sin(t)], h = lines.step * D;
      const sign = hall.poles[design.magnet_north] > 0 ? -1 : 1, pose = { shift: [u, 0, w], tilt: [0, t] };
      const direction = ([x, z]) => {
        const B = HallReadings.fieldAt([x, 0, z], design, pose, hall.poles), size = Math.hypot(B[0], B[2]);
        return [(sign * B[0]) / size, (sign * B[2]) / size];
      };
      const moved = ([x, z], [dx, dz], by) => [x + by * dx, z + by * dz];
      return {
        lines: lines.starts.map((share) => {
          let x = [0, 1].map((i) => share * a * across[i] + (1 + lines.clear) * b * along[i] + centre[i]);
          const line = [x];
          for (let step = 0; step < lines.steps; step++) {
            const k1 = direction(x), k2 = direction(moved(x, k1, h / 2)), k3 = direction(moved(x, k2, h / 2));
            const k4 = direction(moved(x, k3, h));
            x = x.map((v, i) => v + (h / 6) * (k1[i] + 2 * k2[i] + 2 * k3[i] + k4[i]));
            const off = [x[0] - centre[0], x[1] - centre[1]];
            const inside = Math.abs(off[0] * across[0] + off[1] * across[1]) < a && Math.abs(off[0] * along[0] + off[1] * along[1]) < b;
            if (inside) break;
            line.push(x);
            if (!(Math.hypot(...off) < lines.box * D)) break;
          }
          return line;
        }),
      };
    }

    function stabilityPart({ design, magnet }) {
      const reason = refusal(design, { depth: range.shallowest * design.D, plate_tilt: 0, coulomb: null, shearsTip: false }, magnet);
      if (reason) throw new BadInput(`${reason}: take finite elements`);
      const { D, E, density } = design, beam = beamOf(design), critical = beam.criticalDepth();
      const mode = beam.firstMode(design.magnet_density / density), unit = Math.sqrt(E / density) / D;
      return {
        critical_depth: finite(D * critical.value), estimate: finite(D * critical.halfWidth), stable_to: D * beam.stable,
        first_mode_hz: mode && unit * mode.value, first_mode_estimate_hz: mode && unit * mode.halfWidth,
      };
    }

    return { checked, solve, statePart, curvePart, fieldLinesPart, stabilityPart };
  }

  return { load };
})();
