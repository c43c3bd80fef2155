"use strict";
// The page: readout box, data tables and CSV files, themes, and the start of all figures.

const Tip = (() => {
  const box = document.getElementById("tip");
  const live = document.getElementById("live");
  return {
    show(lines, x, y, spoken) {
      box.replaceChildren();
      lines.forEach((line, k) => Tools.html(k ? "div" : "strong", "", box, line));
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

(() => {
  const data = JSON.parse(document.getElementById("report-data").textContent);
  const MOST_ROWS = 200;

  const cell = (value) => {
    const text = value === null || value === undefined ? "" : String(value);
    return /[",\r\n]/.test(text) ? `"${text.replace(/"/g, '""')}"` : text;
  };
  const csv = (rows) => rows.map((row) => row.map(cell).join(",")).join("\r\n") + "\r\n";

  function save(name, text) {
    const link = document.createElement("a");
    const address = URL.createObjectURL(new Blob([text], { type: "text/csv;charset=utf-8" }));
    link.href = address;
    link.download = name;
    document.body.appendChild(link);
    link.click();
    link.remove();
    setTimeout(() => URL.revokeObjectURL(address), 1000);
  }

  // Cells of CSV text, quoted ones too.
  function parse(text) {
    const rows = [[]];
    const take = /("(?:[^"]|"")*"|[^,\r\n]*)(,|\r?\n|$)/g;
    let match;
    while ((match = take.exec(text)) && (match[0] || take.lastIndex < text.length)) {
      const value = match[1];
      rows[rows.length - 1].push(value.startsWith('"') ? value.slice(1, -1).replace(/""/g, '"') : value);
      if (match[2] !== ",") {
        if (take.lastIndex >= text.length) break;
        rows.push([]);
      }
    }
    return rows.filter((row) => row.length > 1 || row[0]);
  }

  function table(rows, box) {
    const wrap = Tools.html("div", "scroll", box);
    const node = Tools.html("table", "", wrap);
    wrap.tabIndex = 0;
    wrap.setAttribute("role", "region");
    wrap.setAttribute("aria-label", "Table, scrolls sideways");
    const head = Tools.html("tr", "", Tools.html("thead", "", node));
    const body = Tools.html("tbody", "", node);
    for (const text of rows[0]) Tools.html("th", "", head, text).scope = "col";
    for (const row of rows.slice(1, MOST_ROWS + 1)) {
      const line = Tools.html("tr", "", body);
      for (const value of row) {
        const number = value !== "" && value !== null && isFinite(value) && typeof value !== "boolean";
        Tools.html(
          "td",
          number ? "number" : "",
          line,
          value === null || value === "" ? "" : number ? Tools.show(Number(value), 6) : String(value),
        );
      }
    }
    if (rows.length - 1 > MOST_ROWS)
      Tools.html("p", "note", box, `The first ${MOST_ROWS} of ${rows.length - 1} rows; the CSV has all.`);
  }

  // A closed table is filled when it is opened: most readers open few.
  function wire(box, rows) {
    const fold = box.querySelector("details.data");
    const button = box.querySelector("button[data-csv]");
    if (fold)
      fold.addEventListener("toggle", () => {
        if (fold.open && !fold.dataset.filled) {
          fold.dataset.filled = "1";
          table(rows(), fold);
        }
      });
    if (button)
      button.addEventListener("click", () =>
        save(button.dataset.csv, box.dataset.table ? data.tables[box.dataset.table] : csv(rows())),
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
    Deformed.start(surface, box);
    wire(box, () => Deformed.rows(surface));
  }
  for (const box of document.querySelectorAll("[data-table]")) wire(box, () => parse(data.tables[box.dataset.table]));
  let waiting = 0;
  window.addEventListener("resize", () => {
    clearTimeout(waiting);
    waiting = setTimeout(drawAll, 60);
  });
  window.addEventListener("scroll", () => Tip.hide(), { passive: true });

  const THEMES = ["auto", "light", "dark"];
  const NAMES = { auto: "Theme: system", light: "Theme: light", dark: "Theme: dark" };
  const button = document.getElementById("theme");
  function theme(name) {
    if (name === "auto") delete document.documentElement.dataset.theme;
    else document.documentElement.dataset.theme = name;
    button.textContent = NAMES[name];
    button.dataset.now = name;
  }
  let kept = "auto";
  // a page opened from a file may have no storage
  try {
    kept = localStorage.getItem("magtip-theme") || "auto";
  } catch {
    kept = "auto";
  }
  theme(THEMES.includes(kept) ? kept : "auto");
  button.addEventListener("click", () => {
    const next = THEMES[(THEMES.indexOf(button.dataset.now) + 1) % THEMES.length];
    theme(next);
    try {
      localStorage.setItem("magtip-theme", next);
    } catch {
      /* the choice lasts as long as the page */
    }
  });
  drawAll().then(() => {
    document.documentElement.dataset.ready = "yes";
  });
})();
