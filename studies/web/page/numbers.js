"use strict";
// Tables of numbers: value and half width of each side, the formula's value, and the difference of two designs.

const Numbers = (() => {
  const { number, width } = Format;

  // What the tables show before the first answer.
  const NONE = [null, null, null];
  const EMPTY = {
    stability: { critical_depth: null, first_mode_hz: null },
    response: { force: NONE, shift: NONE, tilt: null, tilt_y: null, contact_radius: null },
    readings: { elements: ["S1", "S2", "S3"], volts: NONE, rest: NONE },
  };

  // Rows of one side: [name, unit, value, half width, further column]. Half widths follow the picture: NaN until then.
  function response({ response: r, estimates: e, formulas }, level) {
    const f = formulas?.[level];
    const half = (name, k) => (e?.force ? (Array.isArray(e[name]) ? e[name][k] : e[name]) : NaN);
    // the paper's formulas say nothing of a tilt
    const turned = (value) => (level === "paper" && f?.force ? "no formula" : value);
    const row = (name, unit, quantity, k) => [name, unit, r[quantity][k], half(quantity, k), f?.[quantity]?.[k]];
    return [
      row("normal force", "N", "force", 2),
      row("force along x", "N", "force", 0),
      row("force along y", "N", "force", 1),
      row("shift along x", "mm", "shift", 0),
      row("shift along y", "mm", "shift", 1),
      row("shift along z", "mm", "shift", 2),
      ["tilt towards x", "deg", r.tilt, half("tilt", null), turned(f?.tilt)],
      ["tilt towards y", "deg", r.tilt_y, half("tilt", null), turned(f?.tilt_y)],
      ["contact radius", "mm", r.contact_radius, null, f?.contact_radius],
    ];
  }

  function readings({ readings: r }) {
    if (!r?.elements) return [];
    return r.elements.map((name, k) => [
      r.saturated?.[k] ? `${name} (at its rail)` : name,
      r.units?.[k] || "V",
      r.volts[k],
      r.half_width ? r.half_width[k] : NaN,
      r.volts[k] === null ? null : r.volts[k] - r.rest[k],
    ]);
  }

  function decoded({ decoded: d, readings: r }) {
    if (!r?.elements) return [];
    return ["x", "y", "z"].map((name, k) => [
      name === "z" ? "normal force" : `force along ${name}`,
      "N",
      d?.force?.[k],
      d ? d.half_width?.[k] : NaN,
      d?.noise?.[k],
    ]);
  }

  // What the decoded load rests on. The half widths of formulas are those of their fit to the readings.
  function decoding({ decoded: d, readings: r, response: fem }) {
    if (!r?.elements) return "There are no readings to decode.";
    if (!d) return "";
    if (d.level === "calibration")
      return `By the calibration, status ${String(d.status).replaceAll("_", " ")}: 90 % intervals, with noise.`;
    const noise = d.noise ? "" : " Give the Hall elements a noise to see its effect on the forces.";
    const status = String(d.status).replaceAll("_", " ");
    return `By the formulas of level ${d.level}, status ${status}.${offset(d, fem)}${noise}`;
  }

  // How far the forces decoded by formulas are off those of the finite elements whose readings they decode.
  function offset({ force: decoded }, { force: solved } = {}) {
    if (!decoded || !solved) return "";
    const off = decoded.map((value, k) => Math.abs(value - solved[k]));
    const k = off.indexOf(Math.max(...off));
    if (!(off[k] >= 0)) return "";
    const name = k === 2 ? "normal force" : `force along ${"xy"[k]}`;
    const where = `here the ${name} is ${number(off[k])} N off the finite elements`;
    return ` Half widths do not cover the error of the formulas: ${where}.`;
  }

  function stability(s) {
    return [
      ["critical depth", "mm", s.critical_depth, s.estimate],
      ["first mode", "Hz", s.first_mode_hz, s.first_mode_estimate_hz],
      ...listed(s),
    ];
  }

  // Rows that the server has named.
  const listed = (data) =>
    (data?.rows || []).map((row) => [row.name, row.unit, row.value, row.margin ?? row.half_width, row.worst]);

  // One table; `first` and `last` name the columns of the values and beside them, null for none. Only texts change.
  function table(box, first, last) {
    let shape = "";
    let cells = [];
    function build(sides, rows) {
      box.replaceChildren();
      const node = Format.make("table", {}, box);
      const head = Format.make("tr", {}, Format.make("thead", {}, node));
      const body = Format.make("tbody", {}, node);
      const two = sides.length > 1;
      Format.make("th", { scope: "col" }, head, "");
      for (const side of sides)
        Format.make("th", { scope: "col", colspan: 2 }, head, two ? side.toUpperCase() : first);
      if (two) Format.make("th", { scope: "col" }, head, "B − A");
      else if (last) Format.make("th", { scope: "col" }, head, last);
      cells = rows.map((row) => {
        const line = Format.make("tr", {}, body);
        const name = Format.make("th", { scope: "row" }, line, `${row[0]} `);
        Format.make("span", { class: "unit" }, name, row[1]);
        const values = sides.flatMap(() => [
          Format.make("td", { class: "value" }, line),
          Format.make("td", { class: "width" }, line),
        ]);
        const extra = two || last ? Format.make("td", { class: "value extra" }, line) : null;
        return { values, extra };
      });
    }
    return {
      // `data`: for each side its rows; sides without an answer have none
      show(sides, data, titles = {}) {
        const rows = data.find((one) => one.length) || [];
        if (!rows.length) {
          if (shape !== "none") {
            shape = "none";
            box.replaceChildren();
            Format.make("p", { class: "soft" }, box);
          }
          return Format.put(box.firstChild, titles.none || "None.");
        }
        const now = JSON.stringify([sides, rows.map((row) => [row[0], row[1]]), titles]);
        if (now !== shape) {
          shape = now;
          ({ first, last } = { first, last, ...titles });
          build(sides, rows);
        }
        rows.forEach((_, r) => {
          data.forEach((own, k) => {
            Format.put(cells[r].values[2 * k], number(own[r]?.[2]));
            const [value, half] = own[r]?.slice(2) || [];
            const beside = typeof half === "string" ? half : isFinite(value ?? NaN) ? width(half) : "";
            Format.put(cells[r].values[2 * k + 1], beside);
          });
          if (!cells[r].extra) return;
          const [a, b] = data;
          const beside = sides.length > 1 ? (b[r]?.[2] ?? NaN) - (a[r]?.[2] ?? NaN) : a[r]?.[4];
          Format.put(cells[r].extra, typeof beside === "string" ? beside : number(beside));
        });
      },
    };
  }

  return { EMPTY, table, response, readings, decoded, decoding, stability, listed };
})();
