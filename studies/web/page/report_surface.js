"use strict";
// The deformed sensor of a report: the live page's view in 3D with a scale, a readout of its points, and buttons.

const ReportSurface = (() => {
  const REACH = 7;

  function start(data, box) {
    const stage = box.querySelector(".stage");
    const bar = box.querySelector(".scale-bar");
    const label = box.querySelector(".scale-text");
    const angles = { ...SensorView.START };
    const view = SensorView.start(stage, angles, draw);
    let mode = "open";
    let asked = false;

    function show() {
      view.show(data, data.largest, mode);
      draw();
    }

    // Several turns between two frames are drawn once.
    function draw() {
      if (asked) return;
      asked = true;
      requestAnimationFrame(() => {
        asked = false;
        const { low, high } = data;
        const half = Math.hypot(...high.map((v, i) => v - low[i])) / 2 / 1.12;
        view.draw(half, low[2] + high[2]);
        scale(Math.min(stage.clientWidth, stage.clientHeight) / 2 / half);
      });
    }

    // A bar of a round length, some 70 pixels long.
    function scale(perMm) {
      const rough = 70 / perMm;
      const power = 10 ** Math.floor(Math.log10(rough));
      const length = [5, 2, 1].map((m) => m * power).find((l) => l <= rough * 1.6);
      bar.style.width = `${length * perMm}px`;
      label.textContent = `${Format.short(length)} mm`;
    }

    function read(event) {
      const found = event.buttons ? null : view.nearest(event, REACH);
      if (!found) return Tip.hide();
      const where = found.point.map((v) => Format.short(v, 3)).join(", ");
      const texts = [`displacement: ${Format.short(found.value, 3)} mm`, `at x, y, z: ${where} mm`];
      return Tip.show(texts, event.clientX, event.clientY);
    }

    view.canvas.addEventListener("pointermove", read);
    view.canvas.addEventListener("pointerdown", () => Tip.hide());
    view.canvas.addEventListener("pointerleave", () => Tip.hide());
    const button = box.querySelector("[data-open]");
    button.addEventListener("click", () => {
      mode = mode === "open" ? "whole" : "open";
      button.textContent = mode === "open" ? "Show whole" : "Cut open";
      show();
    });
    box.querySelector("[data-reset]").addEventListener("click", () => {
      Object.assign(angles, SensorView.START);
      draw();
    });
    box.querySelector(".colours").style.background =
      `linear-gradient(to right, ${Format.VIRIDIS.map((rgb) => `rgb(${rgb.join(",")})`).join(",")})`;
    show();
    new ResizeObserver(draw).observe(stage);
  }

  function rows(data) {
    const out = [["part", "x (mm)", "y (mm)", "z (mm)", "displacement (mm)"]];
    for (const [name, part] of Object.entries(data.parts))
      part.value.forEach((v, k) =>
        out.push([name, ...[...part.points.slice(3 * k, 3 * k + 3), v].map((one) => Number(one.toFixed(3)))]),
      );
    return out;
  }

  return { start, rows };
})();
