"use strict";
// Tables of numbers: value and half width of each side, the formula's value, and the difference of two designs.

const Numbers = (() => {
  const { number, width } = Format;

  // Rows of one side: [name, unit, value, half width, further columns].
  function response(state, level) {
    const { response: r, estimates: e = {}, formula = {} } = state, half = (name, k) => (Array.isArray(e[name]) ? e[name][k] : e[name]);
    const other = level === "paper" ? formula : formula[level] || formula;
    return [
      ["force, normal", "N", r.force[2], half("force", 2), other.force?.[2]],
      ["force along x", "N", r.force[0], half("force", 0), other.force?.[0]],
      ["force along y", "N", r.force[1], half("force", 1), other.force?.[1]],
      ["shift along x", "mm", r.shift[0], half("shift", 0), other.shift?.[0]],
      ["shift along y", "mm", r.shift[1], half("shift", 1), other.shift?.[1]],
      ["shift along z", "mm", r.shift[2], half("shift", 2), other.shift?.[2]],
      ["tilt", "deg", r.tilt, half("tilt", 0), formula.tilt],
      ["contact radius", "mm", r.contact_radius, half("contact_radius", 0), formula.contact_radius],
    ];
  }

  function readings({ readings: r }) {
    if (!r?.elements) return [];
    return r.elements.map((name, k) => [name, r.unit || "V", r.volts[k], r.half_width?.[k], r.volts[k] - r.rest[k]]);
  }

  function decoded({ decoded: d }) {
    if (!d?.force) return [];
    return ["x", "y", "z"].map((name, k) => [`force ${name === "z" ? "normal" : `along ${name}`}`, "N", d.force[k], d.half_width?.[k], d.noise?.[k]]);
  }

  function stability(s) {
    return [
      ["critical depth", "mm", s.critical_depth, s.estimate],
      ["first mode", "Hz", s.first_mode_hz, s.first_mode_estimate_hz],
      ...(s.rows || []).map((row) => [row.name, row.unit, row.value, row.half_width]),
    ];
  }

  // One table; `last` names the column beside the values, null for none. Nodes are kept, only texts change.
  function table(box, last) {
    let shape = "", cells = [];
    function build(sides, rows) {
      box.replaceChildren();
      const node = Format.make("table", {}, box), head = Format.make("tr", {}, Format.make("thead", {}, node)), body = Format.make("tbody", {}, node);
      const two = sides.length > 1;
      Format.make("th", { scope: "col" }, head, "");
      for (const side of sides) Format.make("th", { scope: "col", colspan: 2 }, head, two ? side.toUpperCase() : "finite elements");
      if (two) Format.make("th", { scope: "col" }, head, "B − A"); else if (last) Format.make("th", { scope: "col" }, head, last);
      Format.make("th", { scope: "col" }, head, "unit");
      cells = rows.map((row) => {
        const line = Format.make("tr", {}, body);
        Format.make("th", { scope: "row" }, line, row[0]);
        const values = sides.flatMap(() => [Format.make("td", { class: "value" }, line), Format.make("td", { class: "width" }, line)]);
        const extra = two || last ? Format.make("td", { class: "value extra" }, line) : null;
        Format.make("td", { class: "unit" }, line, row[1]);
        return { values, extra };
      });
    }
    return {
      // `data`: for each side its rows; sides without an answer have none
      show(sides, data, title) {
        const rows = data.find((one) => one.length) || [];
        const now = JSON.stringify([sides, rows.map((row) => [row[0], row[1]]), title]);
        if (now !== shape) { shape = now; if (title) last = title; build(sides, rows); }
        rows.forEach((_, r) => {
          data.forEach((own, k) => {
            Format.put(cells[r].values[2 * k], number(own[r]?.[2]));
            Format.put(cells[r].values[2 * k + 1], width(own[r]?.[3]));
          });
          if (!cells[r].extra) return;
          const [a, b] = data;
          Format.put(cells[r].extra, number(sides.length > 1 ? (b[r]?.[2] ?? NaN) - (a[r]?.[2] ?? NaN) : a[r]?.[4]));
        });
      },
    };
  }

  return { table, response, readings, decoded, stability };
})();
