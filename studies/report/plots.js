"use strict";
// Figures as SVG: lines, points with intervals, maps of cells. All texts enter by textContent, never as HTML.

const Plots = (() => {
  const NS = "http://www.w3.org/2000/svg";
  const DASHES = ["", "7 4", "2 3", "8 3 2 3"];
  const ruler = document.createElement("canvas").getContext("2d");
  ruler.font = "12px system-ui, -apple-system, \"Segoe UI\", Roboto, Arial, \"Liberation Sans\", sans-serif";
  const wide = (text) => ruler.measureText(text).width;
  const SHAPES = [
    "M4 0A4 4 0 1 1 -4 0A4 4 0 1 1 4 0Z", "M-3.6 -3.6H3.6V3.6H-3.6Z", "M0 -4.8L4.4 3.4H-4.4Z",
    "M0 -5L5 0L0 5L-5 0Z", "M0 4.8L4.4 -3.4H-4.4Z",
    "M-1.6 -4.6H1.6V-1.6H4.6V1.6H1.6V4.6H-1.6V1.6H-4.6V-1.6H-1.6Z", "M0 -5L1.6 -1.6L5 0L1.6 1.6L0 5L-1.6 1.6L-5 0L-1.6 -1.6Z",
  ];

  function make(name, attributes, parent, text) {
    const node = document.createElementNS(NS, name);
    for (const key in attributes) node.setAttribute(key, attributes[key]);
    if (text !== undefined) node.textContent = text;
    if (parent) parent.appendChild(node);
    return node;
  }

  function html(name, className, parent, text) {
    const node = document.createElement(name);
    if (className) node.className = className;
    if (text !== undefined) node.textContent = text;
    if (parent) parent.appendChild(node);
    return node;
  }

  const raised = (n) => String(n).replace(/./g, (c) => (c === "-" ? "⁻" : "⁰¹²³⁴⁵⁶⁷⁸⁹"[c]));

  // A number as a reader expects it: four digits, powers of ten where it is very small or large, a true minus sign.
  function show(value, digits = 4) {
    if (value === null || value === undefined || !isFinite(value)) return "–";
    if (value === 0) return "0";
    const size = Math.abs(value);
    let text;
    if (size >= 1e5 || size < 1e-3) {
      const [mantissa, power] = value.toExponential(digits - 1).split("e");
      const short = String(Number(mantissa));
      text = (short === "1" ? "" : short === "-1" ? "-" : short + " × ") + "10" + raised(Number(power));
    } else text = String(Number(value.toPrecision(digits)));
    return text.replace(/^-/, "−");
  }

  function linearTicks(low, high, count) {
    const rough = (high - low) / Math.max(count, 1), power = 10 ** Math.floor(Math.log10(rough));
    const step = [1, 2, 5, 10].map((m) => m * power).find((s) => s >= rough * 0.999);
    const ticks = [];
    for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k++) ticks.push(Number((k * step).toPrecision(12)));
    return ticks;
  }

  function logTicks(low, high, count) {
    const first = Math.floor(Math.log10(low)), last = Math.ceil(Math.log10(high)), decades = last - first;
    const every = Math.max(1, Math.ceil(decades / count));
    let ticks = [];
    // as many round numbers in each decade as there is room for
    for (const factors of [[1, 2, 5], [1, 3], [1]]) {
      ticks = [];
      for (let k = first; k <= last; k++)
        if (factors.length > 1 || (k - first) % every === 0)
          for (const f of factors) { const v = f * 10 ** k; if (v >= low * 0.999 && v <= high * 1.001) ticks.push(v); }
      if (ticks.length <= count + 1) break;
    }
    // less than a decade has too few round powers
    return ticks.length > 2 || high / low > 10 ? ticks : linearTicks(low, high, count).filter((v) => v > 0);
  }

  // A scale from values to pixels; categories stand at 0, 1, 2 ...
  function scale(axis, values, from, to) {
    if (axis.categories) {
      const n = axis.categories.length, step = (to - from) / n;
      return { at: (v) => from + (v + 0.5) * step, ticks: axis.categories.map((_, k) => k), step: Math.abs(step) };
    }
    const known = values.filter((v) => v !== null && isFinite(v) && (!axis.log || v > 0));
    let low = known.length ? Math.min(...known) : 1, high = known.length ? Math.max(...known) : 2;
    const room = Math.max(2, Math.floor(Math.abs(to - from) / (to > from ? 50 : 38)));
    if (axis.log) {
      if (high / low < 3) { low /= 1.8; high *= 1.8; }
      const pad = (high / low) ** 0.04; low /= pad; high *= pad;
      const a = Math.log10(low), b = Math.log10(high);
      return { at: (v) => from + ((Math.log10(Math.max(v, 1e-300)) - a) / (b - a)) * (to - from), ticks: logTicks(low, high, room), low, high };
    }
    if (low > 0 && low < 0.35 * high) low = 0;
    if (high < 0 && high > 0.35 * low) high = 0;
    // values that differ by rounding errors are one value
    if (high - low <= 1e-9 * Math.max(Math.abs(low), Math.abs(high))) { const d = Math.abs(low) * 0.1 || 1; low -= d; high += d; }
    const pad = 0.04 * (high - low);
    if (low !== 0) low -= pad;
    if (high !== 0) high += pad;
    return { at: (v) => from + ((v - low) / (high - low)) * (to - from), ticks: linearTicks(low, high, room), low, high };
  }

  // All values of a series along x or y, with the ends of its intervals.
  const spanOf = (one, across) => [...(across ? one.x : one.y), ...(Boolean(one.across) === across ? [...(one.low || []), ...(one.high || [])] : [])];
  const indices = (one) => one.drawn || one.x.map((_, k) => k);
  const axisName = (axis) => axis.label.replace(/ \([^)]*\)$/, "");
  const unitOf = (axis) => (axis.label.match(/\(([^)]*)\)$/) || ["", ""])[1];
  const withUnit = (axis, value) => (axis.categories ? axis.categories[Math.round(value)] : (show(value) + " " + unitOf(axis)).trim());

  // Class of a map's value: 0 below the first edge, n above the last.
  const classOf = (value, edges) => edges.filter((edge) => value >= edge).length;

  function cut(text, room) {
    if (wide(text) <= room) return text;
    let most = text.length;
    while (most > 3 && wide(text.slice(0, most)) > room - 12) most--;
    return text.slice(0, most).trimEnd() + "…";
  }

  function drawPanel(figure, panel, box, width, state) {
    const map = figure.kind === "map", x = figure.x, y = figure.y;
    const all = panel.series || [];
    const rows = y.categories ? y.categories.length : 0;
    const top = panel.title ? 28 : 10, bottom = 50;
    const inner = map ? Math.max(60, Math.min(28, 300 / rows + 8) * rows) : rows ? Math.max(rows * (all.some((s) => s.y.some((v) => v % 1)) ? 25 : 19), 60) : state.single ? Math.min(330, Math.max(220, width * 0.5)) : Math.min(290, Math.max(200, width * 0.62));
    const height = top + inner + bottom;
    const ys = all.flatMap((s) => spanOf(s, false)).concat((figure.guides || []).filter((g) => g.axis === "y").map((g) => g.at));
    const sy = scale(y, state.shared ? state.ys : ys, top + inner, top);
    const longest = Math.max(rows ? 0 : 38, ...tickTexts(y, sy).map(wide));
    const left = Math.min(longest + 14, width * (map ? 0.3 : 0.46)) + (y.label ? 20 : 0), right = 12;
    const svg = make("svg", { viewBox: `0 0 ${width} ${height}`, width, height, tabindex: 0, role: "group", class: "panel" });
    svg.style.setProperty("--columns", state.columns);
    svg.setAttribute("aria-roledescription", map ? "map" : "plot");
    svg.setAttribute("aria-label", `${figure.title}${panel.title ? ", " + panel.title : ""}. Arrow keys read it off.`);
    box.appendChild(svg);
    if (panel.title) make("text", { x: left, y: 16, class: "panel-title" }, svg, cut(panel.title, width - left)).appendChild(make("title", {}, null, panel.title));
    const xs = all.flatMap((s) => spanOf(s, true)).concat((figure.guides || []).filter((g) => g.axis === "x").map((g) => g.at));
    const sx = scale(x, state.shared ? state.xs : xs, left, width - right);
    axes(svg, figure, panel.x ? { ...x, label: panel.x } : x, sx, sy, { left, right: width - right, top, bottom: top + inner, width, height });
    const marks = [];
    if (map) cells(svg, figure, panel, sx, sy, marks);
    else {
      const layer = make("g", {}, svg);
      for (const one of all) drawSeries(layer, one, panel.x ? { ...x, label: panel.x } : x, sx, sy, marks, figure);
      nameMarks(layer, marks, { left, right: width - right, top, bottom: top + inner });
    }
    read(svg, figure, panel, marks, { left, right: width - right, top, bottom: top + inner });
  }

  // The power of ten that very small or large ticks of a linear scale leave to one label of the axis.
  function power(axis, scale) {
    const most = Math.max(0, ...scale.ticks.map(Math.abs));
    return axis.log || axis.categories || !most || (most >= 0.01 && most < 1e5) ? 0 : Math.floor(Math.log10(most));
  }

  // The texts of the ticks of a scale, with as many digits as tell them apart.
  function tickTexts(axis, scale) {
    if (axis.categories) return scale.ticks.map((tick) => axis.categories[tick]);
    const p = power(axis, scale);
    let texts = [];
    for (let digits = 4; digits <= 12; digits++) {
      texts = scale.ticks.map((tick) => show(tick / 10 ** p, digits));
      if (new Set(texts).size === texts.length) break;
    }
    return texts;
  }

  // "shift (mm)" as "shift (10⁻³ mm)".
  const inPowers = (label, p) => (!p ? label : /\([^)]*\)$/.test(label) ? label.replace(/\(([^)]*)\)$/, `(10${raised(p)} $1)`) : `${label} (10${raised(p)})`);

  function axes(svg, figure, x, sx, sy, area) {
    const grid = make("g", { class: "grid" }, svg), labels = make("g", { class: "labels" }, svg), map = figure.kind === "map";
    const many = figure.x.categories ? Math.ceil((Math.max(...figure.x.categories.map(wide)) + 8) / sx.step) : 1;
    const [ux, uy] = [power(figure.x, sx), power(figure.y, sy)];
    const [xTexts, yTexts] = [tickTexts(figure.x, sx), tickTexts(figure.y, sy)];
    sx.ticks.forEach((tick, k) => {
      const at = sx.at(tick);
      if (!map) make("line", { x1: at, x2: at, y1: area.top, y2: area.bottom }, grid);
      if (k % many === 0) make("text", { x: at, y: area.bottom + 17, "text-anchor": "middle" }, labels, xTexts[k]);
    });
    sy.ticks.forEach((tick, k) => {
      const at = sy.at(tick), text = yTexts[k];
      if (!map) make("line", { x1: area.left, x2: area.right, y1: at, y2: at }, grid);
      const label = make("text", { x: area.left - 8, y: at + 4, "text-anchor": "end" }, labels, cut(text, area.left - (figure.y.label ? 34 : 14)));
      if (figure.y.categories) make("title", {}, label, text);
    });
    make("path", { d: `M${area.left} ${area.top}V${area.bottom}H${area.right}`, class: "frame" }, svg);
    make("text", { x: (area.left + area.right) / 2, y: area.height - 10, "text-anchor": "middle", class: "axis-label" }, svg, cut(inPowers(x.label, ux), area.width - 10));
    const middle = (area.top + area.bottom) / 2;
    if (figure.y.label) make("text", { x: 13, y: middle, "text-anchor": "middle", transform: `rotate(-90 13 ${middle})`, class: "axis-label" }, svg, cut(inPowers(figure.y.label, uy), area.bottom - area.top + 40));
    const labelled = [];
    for (const guide of figure.guides || []) {
      const across = guide.axis === "y", at = across ? sy.at(guide.at) : sx.at(guide.at);
      make("line", across ? { x1: area.left, x2: area.right, y1: at, y2: at, class: "guide" } : { x1: at, x2: at, y1: area.top, y2: area.bottom, class: "guide" }, svg);
      if (!guide.label || labelled.some((other) => Math.abs(other - at) < 11)) continue;
      labelled.push(at);
      make("text", across ? { x: area.right, y: at - 3, "text-anchor": "end", class: "guide-label" } : { x: at - 4, y: area.top + 11, "text-anchor": "end", class: "guide-label" }, svg, guide.label);
    }
  }

  function drawSeries(layer, one, x, sx, sy, marks, figure) {
    const style = one.style % SHAPES.length, own = indices(one);
    const group = make("g", { class: `s${style}` }, layer);
    const place = (k) => [sx.at(one.x[k]), sy.at(one.y[k])];
    const visible = own.filter((k) => place(k).every(isFinite));
    if (one.line && visible.length > 1)
      make("path", { class: "line", "data-points": visible.length, "stroke-dasharray": DASHES[one.dash % DASHES.length], d: "M" + visible.map((k) => place(k).map((v) => v.toFixed(1)).join(" ")).join("L") }, group);
    for (const k of visible) {
      const [px, py] = place(k);
      if (one.low && one.low[k] !== null) make("path", { class: "whisker", d: one.across ? `M${sx.at(one.low[k]).toFixed(1)} ${py}H${sx.at(one.high[k]).toFixed(1)}` : `M${px} ${sy.at(one.low[k]).toFixed(1)}V${sy.at(one.high[k]).toFixed(1)}` }, group);
      if (one.mark || !one.line || visible.length === 1) make("path", { class: "mark", d: SHAPES[style], transform: `translate(${px.toFixed(1)} ${py.toFixed(1)})` }, group);
      marks.push({ x: px, y: py, series: one, index: k, lines: describe(figure, x, one, k) });
    }
  }

  // Names beside the marks that have one, where no other name or mark is in the way.
  function nameMarks(layer, marks, area) {
    const taken = marks.map((mark) => [mark.x - 5, mark.y - 5, mark.x + 5, mark.y + 5]);
    for (const mark of marks) {
      const text = (mark.series.labels || [])[mark.index];
      if (!text) continue;
      const w = wide(text) * 0.92;
      const places = [[7, 4], [-7 - w, 4], [-w / 2, 16], [-w / 2, -8]].map(([dx, dy]) => [mark.x + dx, mark.y + dy - 9, mark.x + dx + w, mark.y + dy + 2]);
      const free = places.find(([a, b, c, d]) => a > area.left && c < area.right + 8 && b > area.top - 4 && d < area.bottom &&
        !taken.some(([e, f, g, h]) => a < g && e < c && b < h && f < d));
      if (!free) continue;
      taken.push(free);
      make("text", { x: free[0], y: free[3] - 2, class: "point-label" }, layer, text);
    }
  }

  function describe(figure, x, one, k) {
    const lines = [];
    if (one.names) lines.push(one.names[k]);
    if (one.name) lines.push(one.name);
    if (!(one.names && figure.y.categories)) {
      lines.push(`${axisName(x)}: ${withUnit(x, one.x[k])}`, `${axisName(figure.y)}: ${withUnit(figure.y, one.y[k])}`);
    } else lines.push(`${axisName(x)}: ${withUnit(x, one.x[k])}`);
    if (one.low && one.low[k] !== null) lines.push(`from ${show(one.low[k])} to ${show(one.high[k])}`);
    return lines;
  }

  function cells(svg, figure, panel, sx, sy, marks) {
    const layer = make("g", { class: "cells" }, svg), edges = figure.edges;
    panel.cells.forEach((row, r) => row.forEach((value, c) => {
      const px = sx.at(c) - sx.step / 2, py = sy.at(r) - sy.step / 2;
      const known = value !== null, step = known ? classOf(value, edges) : 0;
      make("rect", { x: px + 0.5, y: py + 0.5, width: Math.max(sx.step - 1, 1), height: Math.max(sy.step - 1, 1), class: known ? `mark c${step} of${edges.length}` : "none" }, layer);
      if (known && sx.step >= 30 && sy.step >= 15)
        make("text", { x: px + sx.step / 2, y: py + sy.step / 2 + 4, "text-anchor": "middle", class: `cell-text t${step} of${edges.length}` }, layer, show(value, Math.abs(value) >= 100 ? 3 : 2));
      marks.push({ x: px + sx.step / 2, y: py + sy.step / 2, row: r, column: c, half: [sx.step / 2, sy.step / 2], lines: [
        `${axisName(figure.x)}: ${withUnit(figure.x, c)}`, `${axisName(figure.y)}: ${withUnit(figure.y, r)}`,
        known ? `${figure.value.replace(/ \(%\)$/, "")}: ${show(value)}${/%/.test(figure.value) ? " %" : ""}` : "no result"] });
    }));
  }

  // Readout by pointer and keyboard: the nearest mark, a ring round it, a box beside it, and a live text.
  function read(svg, figure, panel, marks, area) {
    if (!marks.length) return;
    const map = figure.kind === "map", host = svg.parentNode;
    const ring = map ? make("rect", { class: "ring" }, svg) : make("circle", { class: "ring", r: 8 }, svg);
    let current = -1;
    function select(k, spoken) {
      current = k;
      const mark = marks[k];
      ring.style.display = k < 0 ? "none" : "";
      if (k < 0) return Tip.hide();
      if (map) for (const [key, value] of [["x", mark.x - mark.half[0]], ["y", mark.y - mark.half[1]], ["width", 2 * mark.half[0]], ["height", 2 * mark.half[1]]]) ring.setAttribute(key, value);
      else { ring.setAttribute("cx", mark.x); ring.setAttribute("cy", mark.y); }
      const frame = svg.getBoundingClientRect(), factor = frame.width / svg.viewBox.baseVal.width;
      Tip.show((panel.title ? [panel.title] : []).concat(mark.lines), frame.left + mark.x * factor, frame.top + mark.y * factor, spoken);
    }
    select(-1);
    svg.addEventListener("pointermove", (event) => {
      const frame = svg.getBoundingClientRect(), factor = svg.viewBox.baseVal.width / frame.width;
      const px = (event.clientX - frame.left) * factor, py = (event.clientY - frame.top) * factor;
      if (px < area.left - 12 || px > area.right + 12 || py < area.top - 12 || py > area.bottom + 12) return select(-1);
      let best = -1, least = Infinity;
      marks.forEach((mark, k) => { const d = Math.hypot(mark.x - px, mark.y - py); if (d < least) { least = d; best = k; } });
      select(least < (map ? 1e9 : 60) ? best : -1);
    });
    svg.addEventListener("pointerleave", () => select(-1));
    svg.addEventListener("blur", () => select(-1));
    svg.addEventListener("keydown", (event) => {
      const next = step(event.key, marks, current, map);
      if (next === null) return;
      event.preventDefault();
      select(next, true);
    });
    host.classList.add("readable");
  }

  // The mark that a key leads to: left and right along a series or row, up and down to the nearest one of the next.
  function step(key, marks, current, map) {
    if (key === "Escape") return -1;
    if (!["ArrowLeft", "ArrowRight", "ArrowUp", "ArrowDown", "Home", "End"].includes(key)) return null;
    if (current < 0) return 0;
    const now = marks[current], same = (m) => (map ? m.row === now.row : m.series === now.series);
    const own = marks.map((m, k) => k).filter((k) => same(marks[k])), at = own.indexOf(current);
    if (key === "Home") return own[0];
    if (key === "End") return own[own.length - 1];
    if (key === "ArrowLeft") return own[Math.max(at - 1, 0)];
    if (key === "ArrowRight") return own[Math.min(at + 1, own.length - 1)];
    const groups = [...new Set(marks.map((m) => (map ? m.row : m.series)))];
    const shift = (key === "ArrowUp") === map ? 1 : -1, goal = groups[groups.indexOf(map ? now.row : now.series) + shift];
    if (goal === undefined) return current;
    let best = current, least = Infinity;
    marks.forEach((m, k) => { if ((map ? m.row : m.series) === goal && Math.abs(m.x - now.x) < least) { least = Math.abs(m.x - now.x); best = k; } });
    return best;
  }

  function legend(figure, box) {
    box.replaceChildren();
    if (figure.kind === "map") {
      const e = figure.edges, names = [`below ${show(e[0])}`, ...e.slice(1).map((v, k) => `${show(e[k])} to ${show(v)}`), `above ${show(e[e.length - 1])}`];
      html("li", "legend-title", box, figure.value);
      names.forEach((name, k) => {
        const item = html("li", "", box), svg = make("svg", { width: 16, height: 14, viewBox: "0 0 16 14", "aria-hidden": "true" }, item);
        make("rect", { width: 16, height: 14, class: `c${k} of${e.length}` }, svg);
        html("span", "", item, name);
      });
      return;
    }
    const shown = new Map();
    for (const panel of figure.panels) for (const one of panel.series || []) if (one.name && !shown.has(one.name)) shown.set(one.name, one);
    for (const [name, one] of shown) {
      const item = html("li", "", box), svg = make("svg", { width: 30, height: 14, viewBox: "0 0 30 14", "aria-hidden": "true" }, item);
      const style = one.style % SHAPES.length, group = make("g", { class: `s${style}` }, svg);
      if (one.line) make("path", { class: "line", d: "M1 7H29", "stroke-dasharray": DASHES[one.dash % DASHES.length] }, group);
      if (one.mark || !one.line) make("path", { class: "mark", d: SHAPES[style], transform: "translate(15 7)" }, group);
      html("span", "", item, name);
    }
  }

  // All numbers of a figure as rows, the first one the header.
  function rows(figure) {
    const many = figure.panels.length > 1, head = many ? ["panel"] : [], out = [];
    if (figure.kind === "map") {
      for (const p of figure.panels) p.cells.forEach((row, r) => row.forEach((v, c) => out.push([...(many ? [p.title || ""] : []), figure.x.categories[c], figure.y.categories[r], v])));
      return [[...head, figure.x.label, figure.y.label, figure.value], ...out];
    }
    const every = figure.panels.flatMap((p) => p.series || []), named = every.some((s) => s.names), ranged = every.some((s) => s.low);
    for (const p of figure.panels) for (const s of p.series || []) s.x.forEach((v, k) => out.push([
      ...(many ? [p.title || ""] : []), s.name || "", ...(named ? [s.names ? s.names[k] : ""] : []),
      figure.x.categories ? figure.x.categories[v] : v, figure.y.categories ? figure.y.categories[Math.round(s.y[k])] : s.y[k],
      ...(ranged ? [s.low ? s.low[k] : null, s.high ? s.high[k] : null] : [])]));
    return [[...head, "series", ...(named ? ["point"] : []), figure.x.label || "x", figure.y.label || "y", ...(ranged ? ["low", "high"] : [])], ...out];
  }

  function draw(figure, box, width) {
    if (!width) return;
    box.replaceChildren();
    const count = figure.panels.length, listed = figure.y.categories && figure.kind !== "map" && Math.max(...figure.y.categories.map((t) => t.length)) > 18;
    const columns = listed ? 1 : Math.max(1, Math.min(count, Math.floor(width / (figure.kind === "map" ? 290 : 250)), count === 4 ? 2 : figure.columns || 3));
    const gap = 14, each = Math.floor((width - gap * (columns - 1)) / columns);
    const every = figure.panels.flatMap((p) => p.series || []), guides = figure.guides || [];
    const of = (way) => guides.filter((g) => g.axis === way).map((g) => g.at);
    // panels of one quantity share their scales, so that heights compare
    const state = { single: count === 1, columns, shared: count > 1 && figure.shared !== false && !listed, xs: every.flatMap((s) => spanOf(s, true)).concat(of("x")), ys: every.flatMap((s) => spanOf(s, false)).concat(of("y")) };
    for (const panel of figure.panels) drawPanel(figure, panel, box, each, state);
  }

  return { draw, legend, rows, show, html };
})();
