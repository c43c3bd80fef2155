"use strict";
// Figures by Vega, read off by pointer and keys, and the box that says what is read.

const Tip = (() => {
  const box = document.getElementById("tip");
  const live = document.getElementById("live");
  return {
    show(lines, x, y, spoken) {
      box.replaceChildren();
      lines.forEach((line, k) => Format.make(k ? "div" : "strong", {}, box, line));
      box.hidden = false;
      const size = box.getBoundingClientRect();
      const wide = document.documentElement.clientWidth;
      const left = x + 14 + size.width > wide ? Math.max(4, x - 14 - size.width) : x + 14;
      const top = y + 12 + size.height > window.innerHeight ? y - 12 - size.height : y + 12;
      box.style.left = `${left}px`;
      box.style.top = `${Math.max(4, top)}px`;
      if (spoken) live.textContent = lines.join(", ");
    },
    hide() {
      box.hidden = true;
    },
  };
})();

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
    if (one.spec)
      one.columns = Math.max(
        1,
        Math.min(one.columns, Math.floor(width / (one.spec.width + (one.spacing?.column ?? 20)))),
      );
    else if (typeof one.width === "number") one.width = Math.max(180, Math.min(one.width, width - 90));
    return one;
  }

  const lines = (value) =>
    Object.entries(value).map(([name, text]) => (NAMES.includes(name) ? text : `${name}: ${text}`));

  // Draws a description; returns Vega's view of it, whose rows may change.
  async function embedded(spec, box, theme) {
    box.replaceChildren();
    // a line would say what its first point is
    const tooltip = (handler, event, item, value) =>
      value && typeof value === "object" && item.mark.marktype !== "line"
        ? Tip.show(lines(value), event.clientX, event.clientY)
        : Tip.hide();
    // a figure may lack half widths, of which Vega would warn
    const quiet = { actions: false, logLevel: 1 };
    const options = { mode: "vega-lite", renderer: "svg", ast: true, config: theme, tooltip, ...quiet };
    const { view } = await vegaEmbed(box, spec, options);
    const svg = box.querySelector("svg");
    svg.classList.add("figure");
    svg.setAttribute("role", "group");
    svg.setAttribute("aria-label", spec.description);
    svg.tabIndex = 0;
    read(svg);
    return view;
  }

  const draw = (figure, box, theme) => embedded(fitted(figure.spec, box.clientWidth), box, theme);

  // A figure of rows that change; it is built again where its description or the room is another one.
  function changing(box, theme) {
    let built = "";
    let view = null;
    let next = null;
    let busy = false;
    async function update() {
      busy = true;
      while (next) {
        const [spec, rows] = next;
        next = null;
        const key = JSON.stringify([spec, box.clientWidth]);
        if (key !== built) {
          view?.finalize();
          view = await embedded({ ...spec, width: box.clientWidth, datasets: rows }, box, theme);
        }
        built = key;
        for (const [name, data] of Object.entries(rows)) view.data(name, data);
        await view.runAsync();
      }
      busy = false;
    }
    let last = null;
    const show = (...what) => {
      last = next = what;
      if (!busy && box.clientWidth) update();
    };
    return { show, size: () => last && show(...last) };
  }

  // Readout by keys: left and right along a series or a row of cells, up and down to the nearest mark of the next one.
  function read(svg) {
    let current = null;
    function select(node) {
      if (current) current.classList.remove("selected");
      current = node;
      if (!node) return Tip.hide();
      node.classList.add("selected");
      const frame = node.getBoundingClientRect();
      return Tip.show(lines(node.__data__.tooltip), frame.x + frame.width / 2, frame.y + frame.height / 2, true);
    }
    function next(key) {
      const marks = [...svg.querySelectorAll(MARKS)].filter((node) => node.__data__ && node.__data__.tooltip);
      const place = new Map(marks.map((node) => [node, node.getBoundingClientRect()]));
      const groups = new Map();
      for (const node of marks) {
        const row = node.__data__.datum;
        const cell = node.parentNode.classList.contains("mark-rect");
        const name = [row.panel, ...(cell ? [Math.round(place.get(node).y)] : [row.series, row.model])].join();
        groups.set(name, [...(groups.get(name) || []), node]);
      }
      const rows = [...groups.values()];
      const r = rows.findIndex((row) => row.includes(current));
      if (r < 0) return rows[0]?.[0];
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
      if (!["ArrowLeft", "ArrowRight", "ArrowUp", "ArrowDown", "Home", "End"].includes(event.key)) return undefined;
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

  return { draw, changing, rows };
})();
