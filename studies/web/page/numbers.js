"use strict";
// Tables of numbers that the server has named: value and half width of each side, and what stands beside them, or the
// difference of two designs. Only texts change while rows stay. What stands beside may be a list, a column for each.

const Numbers = (() => {
  const { number, width, make, put } = Format;

  // `tables`: that of each side, {columns, rows, message}, undefined before its answer; `chosen` picks what stands by
  // the level of the formulas.
  function table(box) {
    let shape = "";
    let cells = [];
    let note = null;
    function build(sides, rows, [first, ...rest]) {
      box.replaceChildren();
      const node = make("table", {}, box);
      const head = make("tr", {}, make("thead", {}, node));
      const body = make("tbody", {}, node);
      const two = sides.length > 1;
      const extra = two ? ["B − A"] : rest.filter(Boolean);
      make("th", { scope: "col" }, head, "");
      for (const side of sides) make("th", { scope: "col", colspan: 2 }, head, two ? side.toUpperCase() : first);
      for (const title of extra) make("th", { scope: "col" }, head, title);
      cells = rows.map(({ name, unit }) => {
        const line = make("tr", {}, body);
        make("span", { class: "unit" }, make("th", { scope: "row" }, line, `${name} `), unit);
        const values = sides.flatMap(() => ["value", "width"].map((kind) => make("td", { class: kind }, line)));
        return { values, extra: extra.map(() => make("td", { class: "value extra" }, line)) };
      });
      const title = box.closest(".panel").querySelector("h2").textContent;
      note = make("p", { class: "notes", tabindex: 0, role: "region", "aria-label": `Notes: ${title}` }, box);
    }
    return (sides, tables, chosen) => {
      const pick = (one) => (one && typeof one === "object" && !Array.isArray(one) ? one[chosen] : one);
      const { rows = [], columns = ["", ""] } = tables.find((one) => one?.rows.length) || {};
      const titles = columns.map(pick);
      const now = JSON.stringify([sides, rows.map(({ name, unit }) => [name, unit]), titles]);
      if (now !== shape) build(sides, rows, titles);
      shape = now;
      note.previousSibling.hidden = !rows.length;
      const tags = sides.map((side) => (sides.length > 1 ? `${side.toUpperCase()}: ` : ""));
      put(note, Format.once(tables.map((one, k) => [tags[k], pick(one?.message) || ""])));
      cells.forEach(({ values, extra }, r) => {
        const found = tables.map((one) => one?.rows[r]);
        found.forEach((row, k) => {
          put(values[2 * k], number(row?.value));
          put(values[2 * k + 1], width(row?.half_width));
        });
        const [a, b] = found;
        const beside = sides.length > 1 ? (b?.value ?? NaN) - (a?.value ?? NaN) : pick(a?.beside);
        const texts = Array.isArray(beside) ? beside : [beside];
        extra.forEach((node, k) => put(node, typeof texts[k] === "string" ? texts[k] : number(texts[k])));
      });
    };
  }

  return { table };
})();
