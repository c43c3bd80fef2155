// Closed-form mechanics of the beam: analytic/beam.py with its press and shear terms in JavaScript. The equations and
// their sources stand there. Lengths in mm, E in MPa, forces in N. A refused load throws a BadInput.
"use strict";

const BeamFormulas = (() => {
  const general = PythonText.general;
  const TERMS = {
    column: { tip: false, magnet: false, finite: false },
    tip: { tip: true, magnet: false, finite: false },
    magnet: { tip: true, magnet: true, finite: false },
    finite: { tip: true, magnet: true, finite: true },
  };

  /** Return `solve(design, load, level)` with the constants `fitted` of the Python modules. */
  function withConstants(fitted) {
    const effectiveModulus = (design) => design.E / (1 - design.nu ** 2);
    const inertia = (design) => (Math.PI * design.D ** 4) / 64;
    const heightOf = (design) => design.L - design.D / 2;
    const floor = (design, terms) => heightOf(design) - (terms.magnet ? design.magnet_height / 2 : 0);

    function shearingStiffness({ nu, E, D }) {
      const k = (6 * (1 + nu)) / (7 + 6 * nu);
      return ((k * E) / (2 * (1 + nu))) * ((Math.PI * D ** 2) / 4);
    }

    function solve(design, load, level) {
      if (load.plate_tilt)
        throw new BadInput(
          `the formulas cannot model a tilted plate: plate tilt must be 0; got ${general(load.plate_tilt)} rad`);
      const terms = TERMS[level];
      const rigid = terms !== undefined && terms.magnet && design.magnet_diameter > 0;
      InputChecks.checkLoad(design, load, rigid ? "rigid" : "ignored");
      return terms === undefined ? paper(design, load) : abovePaper(design, load, terms);
    }

    function paper(design, load) {
      const R = design.D / 2, { depth } = load;
      if (!(depth <= R))
        throw new BadInput(
          `depth must not exceed the tip radius D/2 = ${general(R)} mm, the limit of contact area (7); got ` +
          `${general(depth)} mm: take a smaller depth, or finite elements`);
      const area = Math.PI * (design.D * depth - depth ** 2), normal = (design.E * area * depth) / design.L;
      const stiffness = (3 * design.E * inertia(design)) / design.L ** 3;
      let share = load.friction === "stick" ? 1 : 0;
      if (load.coulomb !== null) {
        const full = stiffness * load.shear, limit = load.coulomb * normal;
        share = full <= limit ? 1 : limit / full;
      }
      const x = share * load.shear_x, y = share * load.shear_y, ratio = heightOf(design) / design.L;
      return {
        force: [stiffness * x, stiffness * y, normal],
        shift: [ratio * x, ratio * y, -ratio * depth],
        tilt: 0, tilt_y: 0, contact_radius: Math.sqrt(area / Math.PI),
      };
    }

    function abovePaper(design, load, terms) {
      if (load.coulomb !== null)
        throw new BadInput(
          `only level paper models Coulomb friction; got friction ${general(load.coulomb)}: ` +
          "choose level paper, or friction none or stick");
      const pressed = press(design, load.depth, terms), size = load.shear;
      if (!size || load.friction !== "stick")
        return {
          force: [0, 0, pressed.force], shift: [0, 0, -pressed.below], tilt: 0, tilt_y: 0,
          contact_radius: pressed.contact,
        };
      if (!(load.depth > 0))
        throw new BadInput("a shear with friction stick needs a depth above 0 mm: at depth 0 nothing is in contact");
      const answer = terms.tip ? sheared(design, load.depth, size, terms, pressed) : cantilever(design, size, pressed);
      const x = load.shear_x / size, y = load.shear_y / size;
      return {
        force: [x * answer.force, y * answer.force, answer.press],
        shift: [x * answer.shift, y * answer.shift, -answer.sinking],
        tilt: x * answer.tilt, tilt_y: y * answer.tilt, contact_radius: pressed.contact,
      };
    }

    function press(design, depth, terms) {
      const force = dome(design, terms), column = sinking(design, terms);
      const excess = (above) => above + column(force(above))[0] - depth;
      let low = 0, high = depth;
      for (let i = 0; i < 200; i++) {
        const middle = (low + high) / 2;
        if (middle === low || middle === high) break;
        if (excess(middle) < 0) low = middle;
        else high = middle;
      }
      const above = (low + high) / 2, F = force(above), [below, stretch] = column(F);
      const contact = Math.cbrt((3 * F * (design.D / 2)) / (4 * effectiveModulus(design)));
      return { force: F, above, below, contact, stretch };
    }

    /** The force that flattens the dome above the centre, as a function of the flattening. */
    function dome(design, terms) {
      const R = design.D / 2, hertz = (4 / 3) * effectiveModulus(design) * Math.sqrt(R);
      if (!terms.tip) return (above) => hertz * above ** 1.5;
      let stiffer = fitted.sphere;
      if (terms.magnet) {
        const over = R - design.magnet_height / 2;
        const share = 1 - (1 + (design.magnet_diameter / 2 / over) ** 2) ** -1.5;
        stiffer = (1 - share) * fitted.sphere + (share * fitted.thin * R) / over;
      }
      const layer = (fitted.thin * R) / stiffer;
      return (above) => {
        const thickness = terms.finite ? layer * Math.exp((-fitted.thinning * above) / R) : layer;
        const x = Math.sqrt(R * above) / thickness;
        return hertz * above ** 1.5 * (1 + x * (1.133 + x * (1.283 + x * (0.769 + x * 0.0975))));
      };
    }

    /** The sinking of the centre and the stretch of the column, as a function of the force. */
    function sinking(design, terms) {
      const R = design.D / 2, H = heightOf(design), stiffness = design.E * Math.PI * R ** 2;
      if (!terms.tip) return (force) => [H * (force / stiffness), 1];
      const gap = floor(design, terms) / R;
      let length = H / R + fitted.centre * (1 - Math.exp(-(gap ** 2)));
      if (terms.magnet)
        length -= fitted.inclusion * (((design.magnet_diameter / 2) ** 2 * design.magnet_height) / R ** 3) ** (2 / 3);
      const effective = R * Math.max(length, fitted.least * gap);
      if (!terms.finite) return (force) => [effective * (force / stiffness), 1];
      return (force) => {
        const short = shortening(force / stiffness);
        return [effective * short, 1 - short];
      };
    }

    /** 1 - lambda of a neo-Hookean column, 1/lambda^2 - lambda = 3 strain, by Newton's method. */
    function shortening(strain) {
      let u = 2 * strain;
      for (let i = 0; i < 200; i++) {
        const step = (u ** 3 + 3 * u ** 2 + 3 * u * (1 - strain) - 3 * strain) / (3 * (1 + u) ** 2 - 3 * strain);
        u -= step;
        if (Math.abs(step) <= 1e-15 * u) break;
      }
      return u / (1 + u);
    }

    function cantilever(design, shear, pressed) {
      const { L } = design, H = heightOf(design), B = design.E * inertia(design), S = shearingStiffness(design);
      const Q = shear / (L ** 3 / (3 * B) + L / S);
      return {
        force: Q, press: pressed.force, sinking: pressed.below,
        shift: Q * ((H ** 2 * (3 * L - H)) / (6 * B) + H / S),
        tilt: Q * ((H * (2 * L - H)) / (2 * B) + 1 / (2 * S)),
      };
    }

    function sheared(design, depth, shear, terms, pressed) {
      const R = design.D / 2, { stretch } = pressed, offset = heightOf(design) - floor(design, terms);
      let column = {
        length: floor(design, terms) - (terms.finite ? pressed.below : 0),
        offset,
        bending: (design.E * inertia(design) * (stretch ** 2 + 2 / stretch)) / (3 * stretch ** 2),
        shearing: shearingStiffness(design) * stretch,
        arm: R - pressed.above + offset,
        reach: R - (fitted.patch * pressed.contact ** 2) / R + offset,
        patch: pressed.contact,
      };
      let bent, P = pressed.force, sink = pressed.below;
      if (terms.finite) ({ column, bent, P, sink } = inclined(design, column, depth, shear, pressed, terms));
      else bent = bend(design, column, P);
      const ratio = terms.magnet && design.magnet_diameter ? design.magnet_height / design.magnet_diameter : 1;
      const turn = bent.omega + ((bent.gamma / 2) * (ratio ** 2 - 1)) / (ratio ** 2 + 1);
      const shift = bent.w + column.offset * bent.omega;
      return { force: bent.force * shear, press: P, shift: shift * shear, sinking: sink, tilt: turn * shear, stable: bent.stable };
    }

    /** The press force that remains under an inclined column: a root by false position, as in Python. */
    function inclined(design, upright, depth, shear, pressed, terms) {
      const { nudge, settled } = fitted;
      function follow(P) {
        let bent = bend(design, upright, P), column = upright;
        for (let i = 0; i < fitted.rolled; i++) {
          column = { ...upright, patch: upright.patch + fitted.rolls * Math.abs(bent.omega * shear) * (design.D / 2) };
          bent = bend(design, column, P);
        }
        const nudged = bend(design, column, P + nudge * pressed.force);
        const lean = (Math.max((bent.force - nudged.force) / (nudge * pressed.force), 0) * shear ** 2) / 2;
        return { column, bent, there: press(design, Math.max(depth - lean, 0), terms) };
      }
      let low = 0, high = pressed.force, last = 0, P = high;
      let over = follow(low).there.force, short = follow(high).there.force - high;
      while (short < 0 && over > 0 && high - low > settled * pressed.force) {
        P = high - (short * (high - low)) / (short - over);
        const off = follow(P).there.force - P;
        if (Math.abs(off) <= settled * pressed.force) break;
        if (off > 0) [low, over, short] = [P, off, last > 0 ? short / 2 : short];
        else [high, short, over] = [P, off, last < 0 ? over / 2 : over];
        last = off;
      }
      if (over <= 0) P = 0;
      const { column, bent, there } = follow(P);
      return { column, bent, P, sink: there.below + lowering(column, bent, P, shear) };
    }

    /** Response of the column to a shear of 1 mm under the press force P. */
    function bend(design, column, P) {
      const G = design.E / (2 * (1 + design.nu)), R = design.D / 2, { bending: B, shearing: S, length: s } = column;
      const f = 1 + P / S, x = s * Math.sqrt((P * f) / B), [sine, c, t] = ratios(x);
      const give = (2 - design.nu) / (8 * G * column.patch) + fitted.dome / (G * R);
      const hold = (8 * G * column.patch ** 3) / (3 * (1 - design.nu));
      const psi = [(-f / B) * s ** 2 * c, s * sine];
      const w = [(-(f ** 2) / B) * s ** 3 * t + s / S, f * s ** 2 * c];
      const omega = [psi[0] * (1 + P / (2 * S)) + 1 / (2 * S), psi[1] * (1 + P / (2 * S))];
      const a = w.map((shift, i) => shift + column.reach * omega[i]);
      a[0] += give;
      const b = w.map((shift, i) => hold * omega[i] + P * shift);
      b[0] -= f * s * sine + column.arm;
      b[1] += B * Math.cos(x);
      const determinant = a[0] * b[1] - a[1] * b[0];
      const Q = (b[1] - P * a[1]) / determinant, beta = (P * a[0] - b[0]) / determinant;
      const turned = psi[0] * Q + psi[1] * beta;
      return {
        force: Q, w: w[0] * Q + w[1] * beta, omega: omega[0] * Q + omega[1] * beta, gamma: (Q + P * turned) / S, beta,
        stable: determinant > 0 && x < 2 * Math.PI,
      };
    }

    function ratios(x) {
      if (x < 0.03)
        return [1 - x ** 2 / 6 + x ** 4 / 120, 0.5 - x ** 2 / 24 + x ** 4 / 720, 1 / 6 - x ** 2 / 120 + x ** 4 / 5040];
      return [Math.sin(x) / x, 2 * (Math.sin(x / 2) / x) ** 2, (x - Math.sin(x)) / x ** 3];
    }

    function lowering(column, bent, P, shear) {
      const { shearing: S, bending: B } = column, f = 1 + P / S, pieces = 8;
      let total = 0;
      for (let i = 0; i <= pieces; i++) {
        const s = (column.length * i) / pieces, [sine, c] = ratios(s * Math.sqrt((P * f) / B));
        const psi = shear * ((-bent.force * f / B) * s ** 2 * c + bent.beta * s * sine);
        const slope = psi * f + (shear * bent.force) / S;
        total += (psi * slope - psi ** 2 / 2) * (i === 0 || i === pieces ? 1 : i % 2 ? 4 : 2);
      }
      return (total * column.length) / (3 * pieces) + (column.offset * (bent.omega * shear) ** 2) / 2;
    }

    /** Why a load lies outside the range for which a level was calibrated, "" if it lies inside. */
    function outside(design, load, level) {
      if (level === "paper") return "";
      const { D, L, nu } = design, terms = TERMS[level], hasMagnet = design.magnet_diameter > 0, reasons = [];
      const deepest = level === "finite" ? fitted.deepest : 0.06, farthest = level === "finite" ? fitted.farthest : 0.05;
      if (!(L >= 1.1 * D)) reasons.push(`L/D = ${general(L / D, 3)} is below 1.1`);
      if (!(L <= 4 * D)) reasons.push(`L/D = ${general(L / D, 3)} is above 4`);
      if (!(nu >= 0.49)) reasons.push(`nu = ${general(nu)} is below 0.49`);
      if (design.law !== "neo-hookean") reasons.push(`the formulas use E and nu only, not the law ${design.law}`);
      if ((level === "column" || level === "tip") && hasMagnet) reasons.push("the level treats the magnet as silicone");
      if (terms.magnet && hasMagnet) {
        if (!(design.magnet_diameter <= 0.7 * D && design.magnet_height <= 0.5 * D))
          reasons.push("the magnet is wider than 0.7 D or higher than 0.5 D");
        if (!(heightOf(design) - design.magnet_height / 2 >= 0.35 * D))
          reasons.push("less than 0.35 D of silicone lies below the magnet");
      }
      if (!(load.depth <= deepest * D)) reasons.push(`depth is above ${general(deepest)} D = ${general(deepest * D, 3)} mm`);
      const size = load.friction === "stick" ? load.shear : 0;
      if (!(size <= farthest * D)) reasons.push(`shear is above ${general(farthest)} D = ${general(farthest * D, 3)} mm`);
      const limits = reasons.length ? [`outside the range of level ${level}: ${reasons.join(", ")}`] : [];
      return [...limits, ...bucklingRemarks(design, load, terms)].join("; ");
    }

    function bucklingRemarks(design, load, terms) {
      if (!(load.depth > 0)) return [];
      const pressed = press(design, load.depth, terms);
      if (load.friction === "stick") {
        if (!terms.tip) return [];
        const answer = sheared(design, load.depth, load.shear, terms, pressed), texts = [];
        if (!answer.stable) texts.push("the beam would buckle sideways even if the tip stuck to the plate");
        if (!(answer.press > 0)) texts.push("the tip leans so far that the press force vanishes");
        return texts;
      }
      // Haringx's load: the root of P (1 + P / S) = P_E
      const S = shearingStiffness(design), H = heightOf(design);
      const euler = (((Math.PI / 2) / H) ** 2 * design.E * Math.PI * design.D ** 4) / 64;
      const critical = (S / 2) * (Math.sqrt(1 + (4 * euler) / S) - 1);
      if (design.L < 2 * design.D || pressed.force <= critical) return [];
      const at = `at about ${general(critical, 3)} N (Haringx)`;
      return [`a beam whose tip slides freely buckles sideways ${at}: this result is for the upright beam`];
    }

    return { solve, outside, levels: ["paper", ...Object.keys(TERMS)] };
  }

  return { withConstants };
})();
