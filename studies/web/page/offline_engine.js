"use strict";
// The engine of a page without a server: it answers the requests of the page from tables over depth, shear and
// direction that studies/web/offline_tables.py has computed. Between nodes it interpolates linearly, and turns
// vectors.

const OfflineEngine = (packed) => {
  const page = Format.decoded(packed);
  const { readings, decoded, pictures, fixed } = page;
  const LEVEL = page.level;
  const DEGREES = 180 / Math.PI;
  let answer = () => {};
  let opened = () => {};

  // The values of a table at a point, linear between its nodes; NaN beyond its axes and beside nodes without values.
  function at({ axes, channels, values }, point) {
    let corners = [[0, 1]];
    const result = new Float64Array(channels);
    axes.forEach(([low, high, count], k) => {
      const place = ((point[k] - low) / (high - low)) * (count - 1);
      const first = Math.max(0, Math.min(Math.floor(place + 1e-9), count - 2));
      const share = Math.abs(place - first) < 1e-9 ? 0 : Math.abs(place - first - 1) < 1e-9 ? 1 : place - first;
      const out = share < 0 || share > 1;
      const next = (index, step, weight) => [index * count + first + step, out ? NaN : weight];
      corners = corners.flatMap(([index, weight]) => [
        next(index, 0, weight * (1 - share)),
        next(index, 1, weight * share),
      ]);
    });
    for (const [index, weight] of corners)
      if (weight !== 0) for (let c = 0; c < channels; c++) result[c] += weight * values[index * channels + c];
    return result;
  }

  // The answer of a table at a point: its numbers by `at`, null where unknown, and the words of the nearest node.
  function answerAt(table, point) {
    const place = table.axes.reduce((sum, [low, high, count], k) => {
      const node = Math.round(((point[k] - low) / (high - low)) * (count - 1));
      return sum * count + Math.max(0, Math.min(count - 1, node));
    }, 0);
    const words = table.codes ? table.codes.length / (table.values.length / table.channels) : 0;
    const numbers = at(table, point).values();
    const codes = words ? table.codes.subarray(place * words, (place + 1) * words).values() : null;
    function build(part) {
      if (part === null) return null;
      if (typeof part === "string") return table.texts[codes.next().value];
      if (typeof part === "number") {
        const { value } = numbers.next();
        return Number.isFinite(value) ? value : null;
      }
      if (!Array.isArray(part))
        return Object.fromEntries(Object.entries(part).map(([key, one]) => [key, build(one)]));
      const list = part.map(build);
      return list.every((value) => value === null) ? null : list;
    }
    return build(table.template);
  }

  // The load of the page as a place in the tables: a shear below 0 is one in the other direction.
  function placed({ depth, shear, direction }) {
    const turn = (((shear < 0 ? direction + 180 : direction) % 360) + 360) % 360;
    const size = Math.abs(shear);
    // exactly 0 along an axis
    const [c, s] = size ? [Math.cos, Math.sin].map((f) => Number(f(turn / DEGREES).toFixed(15))) : [1, 0];
    const point = [Math.sqrt(depth / fixed.D), size, size ? turn : 0];
    const plane = answerAt(page.plane, point);
    if (!plane.response.force) throw new Error(page.refusal);
    return { depth, size, c, s, point, plane };
  }

  const turned = (vector, { c, s }) =>
    vector && [c * vector[0] - s * vector[1], s * vector[0] + c * vector[1], vector[2]];

  // A response in the plane of the shear in the direction of a load.
  const inDirection = ({ force, shift, tilt, ...more }, load) => ({
    ...more,
    force: turned(force, load),
    shift: turned(shift, load),
    tilt: tilt === null ? null : load.c * tilt,
    tilt_y: tilt === null ? null : load.s * tilt,
  });

  function statePart(load, level) {
    const { response, estimates, formulas, status, message } = load.plane;
    const sizes = { c: Math.abs(load.c), s: Math.abs(load.s) };
    return {
      status,
      message,
      load: { depth: load.depth, shear: [load.c * load.size, load.s * load.size] },
      response: inDirection(response, load),
      estimates: { ...estimates, force: turned(estimates.force, sizes), shift: turned(estimates.shift, sizes) },
      ...read(load),
      formula_level: { level, ...inDirection(formulas[level], load) },
    };
  }

  function read(load) {
    if (!readings) return { readings: page.elements, decoded: null };
    const { half_width, decoded: part } = answerAt(decoded, load.point);
    return {
      readings: { ...page.elements, ...answerAt(readings, load.point), half_width },
      decoded: { ...part, force: turned(part.force, load) },
    };
  }

  // Points (x, z), or (x, y, z), that the magnet carries, at its pose in the plane of the shear.
  function carried(points, width, { plane: { response } }) {
    const { shift, tilt } = response;
    const c = Math.cos(tilt / DEGREES);
    const s = Math.sin(tilt / DEGREES);
    const moved = Array.from(points);
    const up = width - 1;
    for (let k = 0; k < moved.length; k += width) {
      const x = points[k];
      const z = points[k + up] - fixed.H;
      moved[k] = c * x + s * z + shift[0];
      moved[k + up] = c * z - s * x + shift[2] + fixed.H;
    }
    return moved;
  }

  const rows = (values, width) =>
    Array.from({ length: values.length / width }, (_, k) => values.slice(width * k, width * (k + 1)));
  const triangles = rows(Array.from(pictures.triangles), 3);
  const rest = rows(Array.from(pictures.rest), 2);

  // Section and skin at a load, in the plane of the shear.
  function picture({ point }) {
    const values = at(pictures.table, point.slice(0, 2));
    const n = rest.length;
    return {
      along: values.subarray(0, n),
      up: values.subarray(n, 2 * n),
      pressure: values.subarray(2 * n, 3 * n),
      stretch: values.subarray(3 * n, 4 * n),
      skin: values.subarray(4 * n, -1),
      approximate: values[values.length - 1] > 0,
    };
  }

  // A section is drawn along the direction with x > 0, or along y: a shear to the other side is mirrored.
  const way = ({ c, s, size }) => (size && (c < 0 || (c === 0 && s < 0)) ? -1 : 1);

  function section(load, { along, up, pressure, stretch }) {
    const side = way(load);
    const mirrored = (points) => points.map(([x, z]) => [side * x, z]);
    return {
      points: mirrored(rest.map(([x, z], k) => [x + along[k], z + up[k]])),
      rest: mirrored(rest),
      triangles,
      fields: { displacement: along.map((u, k) => Math.hypot(u, up[k])), pressure, stretch },
      magnet: pictures.outline ? mirrored(rows(carried(pictures.outline, 2, load), 2)) : [],
      plate: { z: fixed.L - load.depth, tilt: 0, x: side * load.size },
      direction: [side * load.c, side * load.s],
      elements: fixed.elements,
    };
  }

  function surface(load, { along, up, skin }) {
    const { c, s } = load;
    const still = pictures.skin.points;
    const place = (x, y, z) => [c * x - s * y, s * x + c * y, z];
    const half = (sign) => ({
      points: rows(still, 3).flatMap(([x, y, z], k) =>
        place(x + skin[3 * k], sign * (y + skin[3 * k + 1]), z + skin[3 * k + 2]),
      ),
      value: Array.from({ length: still.length / 3 }, (_, k) =>
        Math.hypot(skin[3 * k], skin[3 * k + 1], skin[3 * k + 2]),
      ),
      triangles: pictures.skin.triangles,
    });
    const cut = {
      points: rest.flatMap(([x, z], k) => place(x + along[k], 0, z + up[k])),
      value: along.map((u, k) => Math.hypot(u, up[k])),
      triangles: pictures.triangles,
    };
    const parts = { back: half(1), front: half(-1), cut };
    if (pictures.pocket) {
      const points = rows(carried(pictures.pocket.points, 3, load), 3).flatMap((point) => place(...point));
      parts.magnet = { points, value: new Float64Array(points.length / 3), triangles: pictures.pocket.triangles };
    }
    return { parts, largest: [...parts.back.value, ...cut.value].reduce((a, b) => Math.max(a, b), 0) };
  }

  function commands({ depth, size, c, s }) {
    const [x, y] = [c * size, s * size].map((v) => Number(v.toPrecision(9)));
    const sheared = size > 0;
    const source = `Load(depth=${depth}${sheared ? `, shear_x=${x}, shear_y=${y}, friction="stick"` : ""})`;
    const shell =
      `${page.commands.shell} --depth ${depth}` + (sheared ? ` --shear=${x} --shear-y=${y} --friction stick` : "");
    return { shell, python: page.commands.python.replace("Load()", source) };
  }

  function parts({ state, formula_level: level, parts: wanted }) {
    const begin = performance.now();
    const load = placed(state.load);
    const drawn = picture(load);
    const lines = pictures.lines;
    const note = drawn.approximate ? "The picture lies beyond the stored ones: it is that of a smaller load." : "";
    const every = {
      state: () => {
        const data = statePart(load, level);
        return {
          ...data,
          message: [data.message, note].filter(Boolean).join(" "),
          section: section(load, drawn),
          seconds: (performance.now() - begin) / 1000,
        };
      },
      curve: () => page.curves[level],
      sensor3d: () => surface(load, drawn),
      stability: () => page.stability,
      commands: () => commands(load),
      field_lines: () => ({
        lines: lines.map((line) => rows(carried(line.flat(), 2, load), 2).map(([x, z]) => [way(load) * x, z])),
      }),
    };
    return wanted.filter((name) => every[name]).map((name) => [name, every[name]()]);
  }

  // The answers come after the present frame; whatever fails reaches the page as a sentence.
  function ask(request) {
    const { number, side } = request;
    setTimeout(() => {
      try {
        for (const [part, data] of parts(request)) answer({ number, side, part, level: LEVEL, data });
      } catch (error) {
        answer({ number, side, error: error.message, field: null });
      }
    }, 0);
  }

  // Files that need no server: texts of the page, and the numbers of the state.
  async function file(name, { state, formula_level: level }) {
    if (name === "state.csv") return new Blob([numbers(statePart(placed(state.load), level))], { type: "text/csv" });
    const text = name === "curve.csv" ? page.curve_files[level] : page.files[name];
    if (text === undefined)
      throw new Error(`This page has no server, which ${name} needs: run magtip explore, or the command line below.`);
    return new Blob([text], { type: "text/plain" });
  }

  function numbers({ response: r, estimates: e, readings: read_ }) {
    const lines = [["quantity", "unit", "value", "half_width"]];
    for (const [name, unit] of [
      ["force", "N"],
      ["shift", "mm"],
    ])
      ["x", "y", "z"].forEach((axis, i) => lines.push([`${name}_${axis}`, unit, r[name][i], e[name]?.[i]]));
    lines.push(
      ["tilt", "deg", r.tilt, e.tilt],
      ["tilt_y", "deg", r.tilt_y, e.tilt],
      ["contact_radius", "mm", r.contact_radius, ""],
    );
    read_?.elements?.forEach((name, i) =>
      lines.push([name.replace(" ", "_"), read_.units[i], read_.volts[i], read_.half_width?.[i]]),
    );
    return lines.map((line) => `${line.map((value) => value ?? "").join(",")}\r\n`).join("");
  }

  return {
    model: page.model,
    sensor: page.sensor,
    start: () => setTimeout(() => opened(), 0),
    ask,
    file,
    fields: async () => page.fields,
    onAnswer(callback) {
      answer = callback;
    },
    onClosed() {},
    onOpened(callback) {
      opened = callback;
    },
  };
};
