"use strict";
// Curves over depth or time and readings as bars, by uPlot, with the model's half widths as whiskers.

const Charts = (() => {
  const HEIGHT = 210;
  const CAP = 3;
  const SERIES = { a: "--s0", b: "--s1" };
  const sign = { force: 1, shift: -1 };

  const axis = (label, more = {}) => ({
    label,
    stroke: () => Format.colour("--soft"),
    grid: { stroke: () => Format.colour("--grid"), width: 1 },
    ticks: { stroke: () => Format.colour("--line"), width: 1 },
    font: "11px system-ui, sans-serif",
    labelFont: "12px system-ui, sans-serif",
    labelSize: 20,
    labelGap: 0,
    size: 34,
    values: (_, splits) => splits.map((v) => (v === null ? "" : String(Number(v.toPrecision(6))).replace("-", "−"))),
    ...more,
  });

  // A plot that is built again where the key of what it shows is another one, and else takes new data only.
  function plot(box, height, { options, data, built = () => {} }) {
    let own = null;
    let key = "";
    function build() {
      own?.destroy();
      box.replaceChildren();
      own = new uPlot({ width: box.clientWidth || 300, height, legend: { show: false }, ...options() }, data(), box);
      built();
    }
    return {
      now: () => own,
      show(next) {
        if (own && next === key) own.setData(data());
        else build();
        key = next;
      },
      clear() {
        own?.destroy();
        own = null;
      },
      size() {
        if (own && box.clientWidth && box.clientWidth !== own.width) own.setSize({ width: box.clientWidth, height });
      },
      redraw() {
        if (own) build();
      },
      canvas: () => own?.ctx.canvas || null,
    };
  }

  function lines(pen, ...segments) {
    pen.beginPath();
    for (const [x, y, u, v] of segments) {
      pen.moveTo(x, y);
      pen.lineTo(u, v);
    }
    pen.stroke();
  }

  function whisker(u, x, value, half) {
    const cap = CAP * uPlot.pxRatio;
    const [low, high] = [value - half, value + half].map((v) => u.valToPos(v, "y", true));
    if (half > 0) lines(u.ctx, [x, low, x, high], [x - cap, low, x + cap, low], [x - cap, high, x + cap, high]);
  }

  // Names of lines with their dashes and colours.
  function legend(box, keys) {
    const list = Format.make("ul", { class: "legend" }, box);
    for (const [label, dash, colour] of keys) {
      const item = Format.make("li", {}, list);
      Format.make("span", { class: "key", "data-dash": dash?.[0] ?? 0, "data-colour": colour }, item);
      Format.make("span", {}, item, label);
    }
  }

  // Force or shift over depth. Data: for each side {depth, values, half, paper, level, name, now}.
  function curve(box, quantity, readout, model) {
    const unit = quantity === "force" ? "N" : "mm";
    const label = quantity === "force" ? "normal force (N)" : "shift downwards (mm)";
    let sides = [];
    const hasLevel = (side) => side.level && side.name !== "paper";

    const series = () =>
      sides.flatMap((side) => {
        const tag = sides.length > 1 ? `${side.side.toUpperCase()}: ` : "";
        const stroke = () => Format.colour(SERIES[side.side]);
        const line = (name, more) => ({ label: `${tag}${name}`, stroke, width: 1.5, spanGaps: true, ...more });
        const formula = (name, dash) => line(name, { dash, points: { show: false } });
        return [
          line(model, { width: 2, points: { show: true, size: 5, fill: stroke } }),
          formula("paper's formula", [6, 4]),
          ...(hasLevel(side) ? [formula(`formula ${side.name}`, [2, 3])] : []),
        ];
      });

    function marks(u) {
      const pen = u.ctx;
      const ratio = uPlot.pxRatio;
      const { left, top, width, height } = u.bbox;
      pen.save();
      pen.beginPath();
      pen.rect(left, top, width, height);
      pen.clip();
      pen.lineWidth = 1.4 * ratio;
      for (const side of sides) {
        pen.strokeStyle = Format.colour(SERIES[side.side]);
        side.depth.forEach((d, k) => whisker(u, u.valToPos(d, "x", true), side.values[k], side.half?.[k]));
        if (!(side.now > 0)) continue;
        const x = u.valToPos(side.now, "x", true);
        pen.setLineDash([2 * ratio, 3 * ratio]);
        lines(pen, [x, top, x, top + height]);
        pen.setLineDash([]);
      }
      pen.restore();
    }

    const data = () =>
      sides.length
        ? uPlot.join(
            sides.map((side) => [side.depth, side.values, side.paper, ...(hasLevel(side) ? [side.level] : [])]),
          )
        : [[]];

    function tell(u) {
      const k = u.cursor.idx;
      const parts = u.series
        .slice(1)
        .map((one, n) => [one.label, u.data[n + 1][k]])
        .filter(([, v]) => v !== null && v !== undefined);
      Format.put(
        readout,
        k === null || k === undefined || !sides.length
          ? "Press without friction. Move over the chart, or use the arrow keys, to read values."
          : `depth ${Format.number(u.data[0][k], 3)} mm: ` +
              parts.map(([name, v]) => `${name} ${Format.number(v)} ${unit}`).join("; "),
      );
    }

    const options = () => ({
      cursor: { y: false, drag: { x: false, y: false } },
      scales: { x: { time: false }, y: { range: (_, low, high) => [Math.min(0, low), Math.max(high * 1.06, 1e-9)] } },
      axes: [axis("depth (mm)"), axis(label, { size: 54 })],
      series: [{}, ...series()],
      hooks: { draw: [marks], setCursor: [tell] },
    });

    const keys = () => series().map(({ label: name, dash }) => [name, dash, name.startsWith("B") ? "b" : "a"]);
    const chart = plot(box, HEIGHT, { options, data, built: () => legend(box, keys()) });
    box.tabIndex = 0;
    box.setAttribute("role", "group");
    box.setAttribute("aria-label", `${label} over depth. Left and right arrow keys read values.`);
    box.addEventListener("keydown", (event) => {
      const way = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
      const u = chart.now();
      if (!way || !u?.data[0].length) return;
      event.preventDefault();
      const k = Math.max(0, Math.min(u.data[0].length - 1, (u.cursor.idx ?? (way > 0 ? -1 : 0)) + way));
      u.setCursor({ left: u.valToPos(u.data[0][k], "x"), top: 10 });
      document.getElementById("live").textContent = readout.textContent;
    });

    return {
      ...chart,
      show(next) {
        const signed = (list) => list?.map((v) => (v === null ? null : v * sign[quantity]));
        sides = next.map((one) => ({
          ...one,
          ...Object.fromEntries(["values", "paper", "level"].map((name) => [name, signed(one[name])])),
        }));
        chart.show(JSON.stringify(sides.map((side) => [side.side, side.name])));
        tell(chart.now());
      },
    };
  }

  // Readings as bars from zero, the value at rest as a line across, the half width as a whisker.
  function readings(box) {
    let sides = [];
    let top = 5;
    const offset = (n) => (sides.length > 1 ? (n - 0.5) * 0.36 : 0);
    const places = () => sides[0].elements.map((_, k) => k + 1);

    function bars(u) {
      const pen = u.ctx;
      const ratio = uPlot.pxRatio;
      const wide = (u.valToPos(1.3, "x", true) - u.valToPos(1, "x", true)) * (sides.length > 1 ? 0.55 : 1);
      const zero = u.valToPos(0, "y", true);
      pen.save();
      sides.forEach((side, n) =>
        side.volts.forEach((v, k) => {
          const x = u.valToPos(k + 1 + offset(n), "x", true);
          const rest = u.valToPos(side.rest[k], "y", true);
          pen.fillStyle = Format.colour(SERIES[side.side]);
          pen.fillRect(x - wide, u.valToPos(v, "y", true), 2 * wide, zero - u.valToPos(v, "y", true));
          pen.strokeStyle = Format.colour("--ink");
          pen.lineWidth = 1.5 * ratio;
          pen.setLineDash([3 * ratio, 2 * ratio]);
          lines(pen, [x - 1.25 * wide, rest, x + 1.25 * wide, rest]);
          pen.setLineDash([]);
          whisker(u, x, v, side.half_width?.[k]);
        }),
      );
      pen.restore();
    }

    const options = () => ({
      cursor: { show: false },
      scales: {
        x: { time: false, range: [0.4, sides[0].elements.length + 0.6] },
        y: { range: () => [sides.some((s) => s.volts.some((v) => v < 0)) ? -top : 0, top] },
      },
      axes: [
        axis(null, {
          // of several chips, whose names would overlap, the number and the axis
          values: (_, splits) => splits.map((v) => (sides[0].elements[v - 1] ?? "").replace(/chip(?=\d)/, "")),
          splits: places,
          grid: { show: false },
          labelSize: 0,
        }),
        axis(`reading (${sides[0].unit})`, { size: 54 }),
      ],
      series: [{}, { stroke: "transparent", points: { show: false } }],
      hooks: { draw: [bars] },
    });
    const chart = plot(box, HEIGHT - 20, { options, data: () => [places(), sides[0].volts] });
    return {
      ...chart,
      show(next, highest) {
        sides = next;
        top = highest;
        if (sides.length)
          chart.show(JSON.stringify([sides.map((side) => side.side), sides[0].elements, sides[0].unit]));
        else chart.clear();
      },
    };
  }

  // Values over the last seconds; data: a list of times and one for each name.
  function overTime(box, names, data, seconds) {
    const colours = ["--s0", "--s1", "--s2"];
    const dashes = [null, [6, 4], [2, 3]];
    const options = () => ({
      cursor: { show: false },
      scales: { x: { time: false, range: (_, __, high) => [Math.max(high - seconds, 0), Math.max(high, seconds)] } },
      axes: [axis("time (s)"), axis("force (N)", { size: 54 })],
      series: [
        {},
        ...names.map((label, k) => ({
          label,
          stroke: () => Format.colour(colours[k]),
          width: 1.5,
          dash: dashes[k] || undefined,
          points: { show: false },
        })),
      ],
    });
    const keys = names.map((label, k) => [label, dashes[k], "abc"[k]]);
    return plot(box, HEIGHT, { options, data, built: () => legend(box, keys) });
  }

  return { curve, readings, overTime };
})();
