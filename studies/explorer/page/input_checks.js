// What a design and a load must obey: geometry/design.py and geometry/loads.py in JavaScript, with the same sentences.
"use strict";

/** An input value that cannot be used; `field` is the name of its control, or null. */
class BadInput extends Error {
  constructor(text, field = null) {
    super(text);
    this.field = field;
  }
}

const InputChecks = (() => {
  const { general } = PythonText;

  /** A design from its fields; `specs` describe each field as `Design` does. */
  function design(fields, specs, limits) {
    const result = {};
    for (const spec of specs) result[spec.name] = checkedField(spec, fields[spec.name]);
    checkDesign(result, limits);
    return result;
  }

  function checkedField({ name, unit, low, high, choices, text }, value) {
    if (choices) {
      if (!choices.includes(value))
        throw new BadInput(`there is no ${name} '${value}': choose one of ${choices.join(", ")}`, name);
      return value;
    }
    if (low === undefined) return prony(value);
    if (typeof value !== "number") throw new BadInput(`${name} must be a number (${text}); got '${value}'`, name);
    const end = unit === "1" ? "" : ` ${unit}`;
    if (!(value >= low && value <= high))
      throw new BadInput(
        `${name} must lie between ${general(low)} and ${general(high)}${end}; got ${general(value)}${end}`, name);
    return value;
  }

  /** A text of Prony branches g:tau, words separated by single blanks: geometry/relaxation.py. */
  function prony(text) {
    const number = "[-+]?(?:\\d+\\.?\\d*|\\.\\d+)(?:[eE][-+]?\\d+)?", form = new RegExp(`^(${number}):(${number})$`);
    const refuse = (sentence) => { throw new BadInput(sentence, "prony"); };
    const words = text.split(/\s+/).filter(Boolean), branches = words.map((word) => {
      const match = word.match(form);
      if (!match) refuse(`prony must list branches g:tau with tau in s, such as 0.05:0.01 0.03:0.1; got '${word}'`);
      return [Number(match[1]), Number(match[2])];
    }).sort((one, other) => one[1] - other[1] || one[0] - other[0]);
    for (const [g, tau] of branches) {
      if (!(g >= 0 && g < 1)) refuse(`prony: the share g of a branch must be at least 0 and less than 1; got ${general(g)}`);
      if (!(tau >= 1e-12 && tau <= 1e12))
        refuse(`prony: the time tau of a branch must lie between 1e-12 and 1e+12 s; got ${general(tau)} s`);
    }
    const sum = branches.reduce((part, [g]) => part + g, 0);
    if (!(sum < 1)) refuse(`prony: the shares g of all branches must add up to less than 1; got ${general(sum)}`);
    const positive = branches.filter(([g]) => g), marks = branches.filter(([g]) => !g);
    positive.forEach(([, tau], i) => {
      if (i && tau === positive[i - 1][1])
        refuse(`prony lists the time tau = ${general(tau)} s twice: give one branch with the sum of both shares`);
    });
    if (words.length && !positive.length)
      refuse("prony lists no branch with a share g above 0: leave it empty; loss_factor=0 makes an elastic silicone");
    if (marks.length && (marks.length !== 2 || marks[0][1] === marks[1][1]))
      refuse("prony: entries with g = 0 mark the covered times, so give two, the shortest and the longest");
    return words.join(" ");
  }

  function checkDesign(design, { least_alpha: leastAlpha, least_wall: leastWall }) {
    const { D, L, hall_low: low, hall_null: rest, hall_high: high } = design;
    if (!(L > D / 2)) throw new BadInput(`L must exceed the tip radius D/2 = ${general(D / 2)} mm; got ${general(L)} mm`, "L");
    if (!(L <= 20 * D)) throw new BadInput(`L must not exceed 20 D = ${general(20 * D)} mm; got ${general(L)} mm`, "L");
    if (!(low < rest && rest < high))
      throw new BadInput(
        "hall_low, hall_null and hall_high must rise; got " +
        `${general(low)}, ${general(rest)} and ${general(high)} V`, "hall_null");
    if (!(design.loss_low < design.loss_high))
      throw new BadInput(
        `loss_low must be less than loss_high = ${general(design.loss_high)} Hz; got ${general(design.loss_low)} Hz`,
        "loss_low");
    if (design.hall_average % 1)
      throw new BadInput(
        `hall_average must be a whole number of samples; got ${general(design.hall_average)}`, "hall_average");
    for (const name of ["ogden_alpha1", "ogden_alpha2"])
      if (!(Math.abs(design[name]) >= leastAlpha))
        throw new BadInput(
          `${name} must be at least ${general(leastAlpha)} or at most -${general(leastAlpha)}; ` +
          `got ${general(design[name])}`, name);
    checkMagnet(design, leastWall);
  }

  function checkMagnet(design, leastWall) {
    const { D, L, magnet_diameter: d, magnet_height: h, magnet_edge_radius: rho, l0 } = design;
    if ((d === 0) !== (h === 0))
      throw new BadInput(
        "magnet_diameter and magnet_height must both be positive, or both 0 for no magnet; got " +
        `${general(d)} and ${general(h)} mm`, "magnet_diameter");
    if (d === 0) return;
    const widest = Math.min(d, h) / 2, R = D / 2;
    if (!(rho <= widest))
      throw new BadInput(
        `magnet_edge_radius must not exceed half the magnet's smaller side = ${general(widest)} mm; ` +
        `got ${general(rho)} mm`, "magnet_edge_radius");
    const wall = Math.min(R - Math.hypot(d / 2 - rho, h / 2 - rho) - rho, R - d / 2, L - R - h / 2);
    if (!(wall >= leastWall - 1e-9))
      throw new BadInput(
        `the magnet (${general(d)} x ${general(h)} mm) leaves ${general(wall, 3)} mm of silicone around it and needs ` +
        `at least ${general(leastWall)} mm: take a smaller magnet or a larger D or L`, "magnet_diameter");
    if (!(l0 > h / 2))
      throw new BadInput(`l0 must exceed half the magnet's height = ${general(h / 2)} mm; got ${general(l0)} mm`, "l0");
  }

  /** A load from the page's fields: shear and direction (deg) give shear_x and shear_y, and `coulomb` is added. */
  function load({ depth = 0, shear = 0, direction = 0, friction = "none", plate_tilt: tilt = 0 }, steepest) {
    const radians = tilt * (Math.PI / 180), [c, s] = unitVector(direction);
    const result = { depth, friction, plate_tilt: radians, shear_x: shear * c + 0, shear_y: shear * s + 0 };
    const most = (steepest * 180) / Math.PI;
    if (!(Math.abs(tilt) <= most))
      throw new BadInput(`--plate-tilt must lie within +-${general(most, 4)} degrees; got ${general(tilt)}`, "plate_tilt");
    if (!(depth >= 0 && depth < Infinity))
      throw new BadInput(`depth must be a finite number of mm, 0 or more; got ${general(depth)}`, "depth");
    for (const name of ["shear_x", "shear_y"])
      if (!Number.isFinite(result[name]))
        throw new BadInput(`shear must be a finite number of mm; got ${general(result[name])}`, "shear");
    if (typeof friction === "string") {
      if (friction !== "none" && friction !== "stick")
        throw new BadInput(
          `friction must be none, stick or a coefficient of 0 or more; got '${friction}'`, "friction");
    } else if (!(friction >= 0 && friction < Infinity))
      throw new BadInput(`friction must be none, stick or a coefficient of 0 or more; got ${general(friction)}`, "friction");
    result.shear = Math.hypot(result.shear_x, result.shear_y);
    // nothing slides before a shear
    if (friction === "stick" && !result.shear) result.friction = "none";
    result.coulomb = typeof friction === "string" || friction === 0 ? null : friction;
    result.shearsTip = result.shear > 0 && (result.friction === "stick" || result.coulomb !== null);
    return result;
  }

  /** Cosine and sine of an angle in degrees, exactly 0 and 1 along the axes. */
  function unitVector(degrees) {
    const quarter = degrees / 90, angle = degrees * (Math.PI / 180);
    if (quarter !== Math.round(quarter)) return [Math.cos(angle), Math.sin(angle)];
    return [[1, 0], [0, 1], [-1, 0], [0, -1]][((quarter % 4) + 4) % 4];
  }

  function checkLoad(design, load, magnet) {
    const rigid = magnet === "rigid", { L } = design;
    if (rigid && !(design.magnet_diameter > 0))
      throw new BadInput("this design has no magnet (magnet_diameter is 0): choose --magnet ignored", "magnet");
    const room = L - (rigid ? design.magnet_height : 0);
    if (!(load.depth < room))
      throw new BadInput(
        `depth must be less than ${general(room)} mm, the silicone on the axis` +
        `${rigid ? " above and below the magnet" : ""}; got ${general(load.depth)} mm`, "depth");
    if (!(load.shear <= 2 * L))
      throw new BadInput(`shear must not exceed 2 L = ${general(2 * L)} mm; got ${general(load.shear)} mm`, "shear");
  }

  return { design, load, checkLoad };
})();
