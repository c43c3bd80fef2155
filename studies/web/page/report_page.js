"use strict";
// The page of a report: data tables and CSV files, themes, and the start of all figures.

(() => {
  const data = JSON.parse(document.getElementById("report-data").textContent, Format.unpacked);
  const MOST_ROWS = 200;

  const cell = (value) => {
    const text = value === null || value === undefined ? "" : String(value);
    return /[",\r\n]/.test(text) ? `"${text.replace(/"/g, '""')}"` : text;
  };
  const csv = (rows) => rows.map((row) => row.map(cell).join(",")).join("\r\n") + "\r\n";

  function table(rows, box) {
    const region = { class: "scroll", tabindex: 0, role: "region", "aria-label": "Table, scrolls sideways" };
    const node = Format.make("table", {}, Format.make("div", region, box));
    const head = Format.make("tr", {}, Format.make("thead", {}, node));
    const body = Format.make("tbody", {}, node);
    for (const text of rows[0]) Format.make("th", { scope: "col" }, head, text);
    for (const row of rows.slice(1, MOST_ROWS + 1)) {
      const line = Format.make("tr", {}, body);
      for (const value of row) {
        const number = value !== "" && value !== null && isFinite(value) && typeof value !== "boolean";
        const text = value === null || value === "" ? "" : number ? Format.short(Number(value), 6) : String(value);
        Format.make("td", { class: number && "number" }, line, text);
      }
    }
    if (rows.length - 1 > MOST_ROWS)
      Format.make("p", { class: "note" }, box, `The first ${MOST_ROWS} of ${rows.length - 1} rows; the CSV has all.`);
  }

  // A closed table is filled when it is opened: most readers open few.
  function wire(box, rows) {
    const fold = box.querySelector("details.data");
    const button = box.querySelector("button[data-csv]");
    fold.addEventListener("toggle", () => table(rows(), fold), { once: true });
    button.addEventListener("click", () =>
      Exports.save(button.dataset.csv, new Blob([csv(rows())], { type: "text/csv" })),
    );
  }

  const drawn = [];
  for (const box of document.querySelectorAll("[data-figure]")) {
    const figure = data.figures[box.dataset.figure];
    const plot = box.querySelector(".plot");
    wire(box, () => Figures.rows(figure));
    drawn.push({ figure, plot, width: 0 });
  }
  // one after the other, so that the first ones are seen at once
  async function drawAll() {
    for (const one of drawn) {
      if (one.width === one.plot.clientWidth) continue;
      one.width = one.plot.clientWidth;
      await Figures.draw(one.figure, one.plot, data.theme);
    }
  }
  for (const box of document.querySelectorAll("[data-surface]")) {
    const surface = data.surfaces[box.dataset.surface];
    ReportSurface.start(surface, box);
    wire(box, () => ReportSurface.rows(surface));
  }
  for (const box of document.querySelectorAll("[data-table]")) wire(box, () => data.tables[box.dataset.table]);
  let waiting = 0;
  window.addEventListener("resize", () => {
    clearTimeout(waiting);
    waiting = setTimeout(drawAll, 60);
  });
  window.addEventListener("scroll", () => Tip.hide(), { passive: true });

  Theme.start(document.getElementById("theme"));
  drawAll().then(() => {
    document.documentElement.dataset.ready = "yes";
  });
})();
