"use strict";
// Curves over depth and readings as bars, by uPlot, with the model's half widths as whiskers.

const Charts = (() => {
  const HEIGHT = 210;
  const CAP = 3;
  const SERIES = { a: "--s0", b: "--s1" };
  const sign = { force: 1, shift: -1 };

  const axes = (x, y, extra = {}) => [
    { label: x, ...axis(), ...extra },
    { label: y, ...axis(), size: 54 },
  ];
  const axis = () => ({
    stroke: () => Format.colour("--soft"),
    grid: { stroke: () => Format.colour("--grid"), width: 1 },
    ticks: { stroke: () => Format.colour("--line"), width: 1 },
    font: "11px system-ui, sans-serif",
    labelFont: "12px system-ui, sans-serif",
    labelSize: 20,
    labelGap: 0,
    size: 34,
    values: (_, splits) => splits.map((v) => (v === null ? "" : String(Number(v.toPrecision(6))).replace("-", "−"))),
  });

  function whisker(pen, x, low, high, ratio) {
    pen.beginPath();
    pen.moveTo(x, low);
    pen.lineTo(x, high);
    for (const y of [low, high]) {
      pen.moveTo(x - CAP * ratio, y);
      pen.lineTo(x + CAP * ratio, y);
    }
    pen.stroke();
  }

  // Force or shift over depth. Data: for each side {depth, values, half, paper, level, name, now}.
  function curve(box, quantity, readout, model) {
    const unit = quantity === "force" ? "N" : "mm";
    const label = quantity === "force" ? "normal force (N)" : "shift downwards (mm)";
    let plot = null;
    let sides = [];
    let key = "";
    let legend = null;

    const lines = () =>
      sides.flatMap((side) => {
        const tag = sides.length > 1 ? `${side.side.toUpperCase()}: ` : "";
        const stroke = () => Format.colour(SERIES[side.side]);
        return [
          {
            label: `${tag}${model}`,
            stroke,
            width: 2,
            spanGaps: true,
            points: { show: true, size: 5, fill: stroke },
          },
          {
            label: `${tag}paper's formula`,
            stroke,
            width: 1.5,
            dash: [6, 4],
            spanGaps: true,
            points: { show: false },
          },
          ...(side.level && side.name !== "paper"
            ? [
                {
                  label: `${tag}formula ${side.name}`,
                  stroke,
                  width: 1.5,
                  dash: [2, 3],
                  spanGaps: true,
                  points: { show: false },
                },
              ]
            : []),
        ];
      });

    function marks(u) {
      const pen = u.ctx;
      const ratio = uPlot.pxRatio;
      pen.save();
      pen.beginPath();
      pen.rect(u.bbox.left, u.bbox.top, u.bbox.width, u.bbox.height);
      pen.clip();
      pen.lineWidth = 1.4 * ratio;
      for (const side of sides) {
        pen.strokeStyle = Format.colour(SERIES[side.side]);
        side.depth.forEach((d, k) => {
          const half = side.half?.[k];
          if (half > 0)
            whisker(
              pen,
              u.valToPos(d, "x", true),
              u.valToPos(side.values[k] - half, "y", true),
              u.valToPos(side.values[k] + half, "y", true),
              ratio,
            );
        });
        if (side.now > 0) {
          const x = u.valToPos(side.now, "x", true);
          pen.setLineDash([2 * ratio, 3 * ratio]);
          pen.beginPath();
          pen.moveTo(x, u.bbox.top);
          pen.lineTo(x, u.bbox.top + u.bbox.height);
          pen.stroke();
          pen.setLineDash([]);
        }
      }
      pen.restore();
    }

    function table() {
      return sides.length
        ? uPlot.join(
            sides.map((side) => [
              side.depth,
              side.values,
              side.paper,
              ...(side.level && side.name !== "paper" ? [side.level] : []),
            ]),
          )
        : [[]];
    }

    function tell(u) {
      const k = u.cursor.idx;
      const side = sides[0];
      if (k === null || k === undefined || !side)
        return Format.put(
          readout,
          "Press without friction. Move over the chart, or use the arrow keys, to read values.",
        );
      const parts = u.series
        .slice(1)
        .map((one, n) => [one.label, u.data[n + 1][k]])
        .filter(([, v]) => v !== null && v !== undefined);
      Format.put(
        readout,
        `depth ${Format.number(u.data[0][k], 3)} mm: ` +
          parts.map(([name, v]) => `${name} ${Format.number(v)} ${unit}`).join("; "),
      );
    }

    function build() {
      plot?.destroy();
      box.replaceChildren();
      const options = {
        width: box.clientWidth || 300,
        height: HEIGHT,
        legend: { show: false },
        cursor: { y: false, drag: { x: false, y: false } },
        scales: {
          x: { time: false },
          y: { range: (_, low, high) => [Math.min(0, low), Math.max(high * 1.06, 1e-9)] },
        },
        axes: axes("depth (mm)", label),
        series: [{}, ...lines()],
        hooks: { draw: [marks], setCursor: [tell] },
      };
      plot = new uPlot(options, table(), box);
      legend = Format.make("ul", { class: "legend" }, box);
      for (const one of lines()) {
        const item = Format.make("li", {}, legend);
        Format.make(
          "span",
          {
            class: "key",
            style: null,
            "data-dash": one.dash ? one.dash[0] : 0,
            "data-colour": one.label.startsWith("B") ? "b" : "a",
          },
          item,
        );
        Format.make("span", {}, item, one.label);
      }
    }

    box.tabIndex = 0;
    box.setAttribute("role", "group");
    box.setAttribute("aria-label", `${label} over depth. Left and right arrow keys read values.`);
    box.addEventListener("keydown", (event) => {
      const way = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
      if (!way || !plot?.data[0].length) return;
      event.preventDefault();
      const k = Math.max(0, Math.min(plot.data[0].length - 1, (plot.cursor.idx ?? (way > 0 ? -1 : 0)) + way));
      plot.setCursor({ left: plot.valToPos(plot.data[0][k], "x"), top: 10 });
      document.getElementById("live").textContent = readout.textContent;
    });

    return {
      show(next) {
        const signed = (list) => list?.map((v) => (v === null ? null : v * sign[quantity]));
        sides = next.map((one) => ({
          ...one,
          values: signed(one.values),
          paper: signed(one.paper),
          level: signed(one.level),
        }));
        const now = JSON.stringify(sides.map((side) => [side.side, side.name]));
        if (!plot || now !== key) {
          key = now;
          build();
        } else plot.setData(table());
        tell(plot);
      },
      size() {
        if (plot && box.clientWidth && box.clientWidth !== plot.width)
          plot.setSize({ width: box.clientWidth, height: HEIGHT });
      },
      redraw() {
        if (plot) {
          key = "";
          build();
        }
      },
      canvas: () => plot?.ctx.canvas || null,
    };
  }

  // Readings as bars from zero, the value at rest as a line across, the half width as a whisker.
  function readings(box) {
    let plot = null;
    let sides = [];
    let key = "";
    let top = 5;
    const columns = () => sides[0]?.elements.length || 0;
    const offset = (n) => (sides.length > 1 ? (n - 0.5) * 0.36 : 0);
    const xs = () => [...Array(columns()).keys()].map((k) => k + 1);

    function bars(u) {
      const pen = u.ctx;
      const ratio = uPlot.pxRatio;
      const wide = (u.valToPos(1.3, "x", true) - u.valToPos(1, "x", true)) * (sides.length > 1 ? 0.55 : 1);
      const zero = u.valToPos(0, "y", true);
      pen.save();
      sides.forEach((side, n) =>
        side.volts.forEach((v, k) => {
          const x = u.valToPos(k + 1 + offset(n), "x", true);
          const y = u.valToPos(v, "y", true);
          const rest = u.valToPos(side.rest[k], "y", true);
          const half = side.half_width?.[k];
          pen.fillStyle = Format.colour(SERIES[side.side]);
          pen.fillRect(x - wide, y, 2 * wide, zero - y);
          pen.strokeStyle = Format.colour("--ink");
          pen.lineWidth = 1.5 * ratio;
          pen.setLineDash([3 * ratio, 2 * ratio]);
          pen.beginPath();
          pen.moveTo(x - 1.25 * wide, rest);
          pen.lineTo(x + 1.25 * wide, rest);
          pen.stroke();
          pen.setLineDash([]);
          if (half > 0) whisker(pen, x, u.valToPos(v - half, "y", true), u.valToPos(v + half, "y", true), ratio);
        }),
      );
      pen.restore();
    }

    function build() {
      plot?.destroy();
      box.replaceChildren();
      const names = sides[0].elements;
      const horizontal = {
        values: (_, splits) => splits.map((v) => names[v - 1] ?? ""),
        splits: () => xs(),
        grid: { show: false },
      };
      plot = new uPlot(
        {
          width: box.clientWidth || 300,
          height: HEIGHT - 20,
          legend: { show: false },
          cursor: { show: false },
          scales: {
            x: { time: false, range: [0.4, columns() + 0.6] },
            y: { range: () => [sides.some((s) => s.volts.some((v) => v < 0)) ? -top : 0, top] },
          },
          axes: axes(null, `reading (${sides[0].unit})`, { ...horizontal, labelSize: 0 }),
          series: [{}, { stroke: "transparent", points: { show: false } }],
          hooks: { draw: [bars] },
        },
        [xs(), sides[0].volts],
        box,
      );
    }

    return {
      show(next, highest) {
        sides = next;
        top = highest;
        if (!sides.length) {
          plot?.destroy();
          plot = null;
          key = "";
          return;
        }
        const now = JSON.stringify([sides.map((side) => side.side), sides[0].elements, sides[0].unit]);
        if (!plot || now !== key) {
          key = now;
          build();
        } else plot.setData([xs(), sides[0].volts]);
      },
      size() {
        if (plot && box.clientWidth && box.clientWidth !== plot.width)
          plot.setSize({ width: box.clientWidth, height: HEIGHT - 20 });
      },
      redraw() {
        if (plot) build();
      },
      canvas: () => plot?.ctx.canvas || null,
    };
  }

  return { curve, readings };
})();
