"use strict";
// Forces that `magtip stream --page` decodes: the last seconds as curves, the last row as numbers, and a zero.

const Measured = (panel, zero) => {
  const SECONDS = 20;
  const NAMES = ["force along x", "force along y", "normal force"];
  const lists = [[], [], [], []];
  const chart = Charts.overTime(panel.querySelector(".chart"), NAMES, () => lists, SECONDS);
  const table = panel.querySelector("tbody");
  const cells = NAMES.map((name) => {
    const row = Format.make("tr", {}, table);
    Format.make("th", { scope: "row" }, row, name);
    return [0, 1].map(() => Format.make("td", {}, row));
  });
  panel.querySelector("button").addEventListener("click", zero);

  // Rows are [time, force along x, along y, normal force, half widths of these or none, status].
  return ({ rows, rate, lost, ended }) => {
    panel.hidden = false;
    for (const row of rows) lists.forEach((list, k) => list.push(row[k]));
    const first = lists[0].findIndex((time) => time > lists[0].at(-1) - SECONDS);
    for (const list of lists) list.splice(0, Math.max(first, 0));
    chart.show("force");
    const last = rows.at(-1);
    if (last)
      cells.forEach(([value, half], k) => {
        Format.put(value, last[k + 1] === null ? "no force" : `${Format.number(last[k + 1])} N`);
        Format.put(half, last[k + 4] === null ? "" : `± ${Format.number(last[k + 4], 2)} N`);
      });
    const status = last ? `${last[7].replaceAll("_", " ")}; ` : "";
    const state = ended ? "the stream has ended" : `${status}${Math.round(rate)} rows per second`;
    Format.put(panel.querySelector(".state"), `${state}; ${lost} frames lost`);
  };
};
