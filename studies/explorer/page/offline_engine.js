// The engine of a page without a server: it answers the requests of the page from data in the page itself.
"use strict";

const OfflineEngine = ({ fields: controls, model: encoded, sections: states }) => {
  const data = OfflineData.decoded(encoded), model = OfflineModel.load(data), pictures = StoredSections.load(OfflineData.decoded(states));
  const LEVEL = "surrogate", curves = new Map();
  let answer = () => {}, opened = () => {};

  /** The picture's parts, which come first. */
  function first(state, wanted) {
    const begin = performance.now(), result = {};
    if (wanted("commands")) result.commands = StateCommands.commands(state, data.fields);
    if (!wanted("state") && !wanted("sensor3d")) return { result };
    const { plane } = model.solve(state), [u, w, t] = plane.value;
    const { section, note } = pictures.section(state.design, { load: state.load, pose: { u, w, t } });
    if (wanted("state")) {
      result.state = { ...model.statePart(state), section, message: note, seconds: (performance.now() - begin) / 1000 };
    }
    return { result, section };
  }

  function rest(state, section, wanted) {
    const result = {};
    if (wanted("sensor3d")) result.sensor3d = pictures.surface(section);
    if (wanted("field_lines")) result.field_lines = model.fieldLinesPart(state);
    if (wanted("stability")) result.stability = model.stabilityPart(state);
    if (wanted("curve")) result.curve = curveOf(state);
    return result;
  }

  /** The curve, which depends on the design and the formulas only; the last of each design is kept. */
  function curveOf(state) {
    const key = JSON.stringify([state.design, state.magnet, state.formulaLevel]);
    if (!curves.has(key)) {
      if (curves.size > 3) curves.delete(curves.keys().next().value);
      curves.set(key, model.curvePart(state));
    }
    return curves.get(key);
  }

  /** Answer after the present frame, the picture before everything else; an error names the field that causes it. */
  function ask({ number, side, state: asked, formula_level: formulaLevel, parts }) {
    const wanted = (name) => parts.includes(name);
    const send = (result) => Object.entries(result).forEach(([part, one]) => answer({ number, side, part, level: LEVEL, data: one }));
    const guarded = (compute) => setTimeout(() => {
      try {
        compute();
      } catch (error) {
        if (!(error instanceof BadInput)) throw error;
        answer({ number, side, error: error.message, field: error.field });
      }
    }, 0);
    guarded(() => {
      const state = model.checked(asked, formulaLevel), { result, section } = first(state, wanted);
      send(result);
      guarded(() => send(rest(state, section, wanted)));
    });
  }

  /** Files that need no server: the design, and the numbers of the state. */
  async function file(name, { state, formula_level: formulaLevel }) {
    if (name === "design.toml") return new Blob([design(model.checked(state, formulaLevel).design)], { type: "text/plain" });
    if (name === "state.csv") return new Blob([numbers(model.statePart(model.checked(state, formulaLevel)))], { type: "text/csv" });
    throw new Error(`This page has no server, which ${name} needs: run magtip explore, or the command line below.`);
  }

  const design = (values) => data.fields.map(({ name }) => `${name} = ${typeof values[name] === "string" ? `"${values[name]}"` : toml(values[name])}\n`).join("");
  const toml = (value) => (Number.isInteger(value) ? value.toFixed(1) : String(value));

  function numbers({ response, estimates, readings }) {
    const rows = [["quantity", "unit", "value", "half_width"]];
    for (const [name, unit] of [["force", "N"], ["shift", "mm"]])
      ["x", "y", "z"].forEach((axis, i) => rows.push([`${name}_${axis}`, unit, response[name][i], estimates[name][i]]));
    rows.push(["tilt", "deg", response.tilt, estimates.tilt], ["tilt_y", "deg", response.tilt_y, estimates.tilt]);
    rows.push(["contact_radius", "mm", response.contact_radius, estimates.contact_radius]);
    readings.elements.forEach((name, i) => rows.push([name.replace(" ", "_"), readings.units[i], readings.volts[i], readings.half_width[i]]));
    return rows.map((row) => `${row.join(",")}\r\n`).join("");
  }

  return {
    model: LEVEL,
    start: () => setTimeout(() => opened(), 0),
    ask,
    file,
    fields: async () => controls,
    onAnswer(callback) { answer = callback; },
    onClosed() {},
    onOpened(callback) { opened = callback; },
  };
};
