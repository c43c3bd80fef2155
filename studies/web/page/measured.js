"use strict";
// Forces that `magtip stream --page` decodes: the last seconds as curves, the last row as numbers, and a zero.

const Measured = (panel, { measured, theme }, zero) => {
  const SECONDS = 20;
  const NAMES = ["force along x", "force along y", "normal force"];
  const figure = Figures.changing(panel.querySelector(".chart"), theme);
  const table = Numbers.table(panel.querySelector(".numbers"));
  const kept = [];
  panel.querySelector("button").addEventListener("click", zero);

  // Rows are [time, force along x, along y, normal force, half widths of these or none, status].
  return ({ rows, rate, lost, ended }) => {
    panel.hidden = false;
    kept.push(...rows);
    const last = kept.at(-1);
    // rows whose time is not known are no points of the curves
    const timed = kept.filter((row) => row[0] !== null);
    kept.splice(0, kept.length, ...timed.filter((row) => row[0] >= timed.at(-1)[0] - SECONDS));
    figure.show(measured, {
      rows: NAMES.flatMap((model, k) => kept.map((row) => ({ model, time: row[0], value: row[k + 1] }))),
    });
    const numbers = NAMES.map((name, k) => ({ name, unit: "N", value: last?.[k + 1], half_width: last?.[k + 4] }));
    const status = last && !ended ? `${last[7].replaceAll("_", " ")}; ` : "";
    const state = ended ? "the stream has ended" : `${status}${Math.round(rate)} rows per second`;
    Format.put(panel.querySelector(".state"), `${state}; ${lost} frames lost`);
    table(["a"], [{ columns: ["", ""], rows: numbers, message: "" }]);
  };
};
