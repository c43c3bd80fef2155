"use strict";
// Figures by Vega, read off by pointer and keys.

const Figures = (() => {
  const MARKS = ".mark-symbol.role-mark path, .mark-rect.role-mark path";
  const NAMES = ["panel", "point", "series", "model"];

  const unpacked = (column) => (Array.isArray(column) ? column : column.at.map((k) => column.texts[k]));
  const objects = (packed) => {
    const columns = Object.entries(packed).map(([name, column]) => [name, unpacked(column)]);
    const count = columns.length ? columns[0][1].length : 0;
    return Array.from({ length: count }, (_, k) =>
      Object.fromEntries(columns.map(([name, column]) => [name, column[k]])),
    );
  };

  // As many panels side by side as there is room for; one panel alone is as wide as the text.
  function fitted(spec, width) {
    const one = JSON.parse(JSON.stringify(spec));
    one.datasets = Object.fromEntries(
      Object.entries(one.datasets).map(([name, columns]) => [name, objects(columns)]),
    );
    if (one.spec) one.columns = Math.max(1, Math.min(one.columns, Math.floor(width / (one.spec.width + 20))));
    else if (typeof one.width === "number") one.width = Math.max(180, Math.min(one.width, width - 90));
    return one;
  }

  const lines = (value) =>
    Object.entries(value).map(([name, text]) => (NAMES.includes(name) ? text : `${name}: ${text}`));

  async function draw(figure, box, theme) {
    box.replaceChildren();
    const tooltip = (handler, event, item, value) =>
      value && typeof value === "object" ? Tip.show(lines(value), event.clientX, event.clientY) : Tip.hide();
    const options = { mode: "vega-lite", renderer: "svg", ast: true, actions: false, config: theme, tooltip };
    await vegaEmbed(box, fitted(figure.spec, box.clientWidth), options);
    const svg = box.querySelector("svg");
    svg.classList.add("panel");
    svg.tabIndex = 0;
    read(svg);
  }

  // Readout by keys: left and right along a series or a row of cells, up and down to the nearest mark of the next one.
  function read(svg) {
    const marks = [...svg.querySelectorAll(MARKS)].filter((node) => node.__data__ && node.__data__.tooltip);
    const place = new Map(marks.map((node) => [node, node.getBBox ? node.getBoundingClientRect() : null]));
    const keyOf = (node) => {
      const row = node.__data__.datum;
      const cell = node.parentNode.classList.contains("mark-rect");
      return JSON.stringify([row.panel, ...(cell ? [Math.round(place.get(node).y)] : [row.series, row.model])]);
    };
    const groups = new Map();
    for (const node of marks) groups.set(keyOf(node), [...(groups.get(keyOf(node)) || []), node]);
    const rows = [...groups.values()];
    let current = null;
    function select(node) {
      if (current) current.classList.remove("selected");
      current = node;
      if (!node) return Tip.hide();
      node.classList.add("selected");
      const frame = node.getBoundingClientRect();
      Tip.show(lines(node.__data__.tooltip), frame.x + frame.width / 2, frame.y + frame.height / 2, true);
    }
    function next(key) {
      if (!current) return rows[0][0];
      const r = rows.findIndex((row) => row.includes(current));
      const row = rows[r];
      const at = row.indexOf(current);
      if (key === "Home") return row[0];
      if (key === "End") return row[row.length - 1];
      if (key === "ArrowLeft") return row[Math.max(at - 1, 0)];
      if (key === "ArrowRight") return row[Math.min(at + 1, row.length - 1)];
      const other = rows[Math.max(0, Math.min(rows.length - 1, r + (key === "ArrowDown" ? 1 : -1)))];
      const off = (node) => Math.abs(place.get(node).x - place.get(current).x);
      return other === row ? current : other.reduce((best, node) => (off(node) < off(best) ? node : best));
    }
    svg.addEventListener("blur", () => select(null));
    svg.addEventListener("keydown", (event) => {
      if (event.key === "Escape") return select(null);
      if (!rows.length || !["ArrowLeft", "ArrowRight", "ArrowUp", "ArrowDown", "Home", "End"].includes(event.key))
        return undefined;
      event.preventDefault();
      return select(next(event.key));
    });
  }

  // All numbers of a figure as rows, the first one the header.
  function rows(figure) {
    const columns = figure.columns;
    const name = figure.spec.data.name;
    return [columns, ...objects(figure.spec.datasets[name]).map((row) => columns.map((column) => row[column]))];
  }

  return { draw, rows };
})();
