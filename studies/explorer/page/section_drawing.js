"use strict";
// Drawing of a deformed section on a canvas: colours, outlines, magnet, plate, Hall elements, field lines, colour bar.

const SectionDrawing = (() => {
  const FLAT = 0.004, BAR = 12, ROOM = 74;
  const FIELDS = {
    displacement: { label: "displacement (mm)", map: Format.VIRIDIS, signed: false, from: 0 },
    pressure: { label: "pressure (MPa)", map: Format.SIGNED, signed: true, from: 0 },
    stretch: { label: "largest stretch", map: Format.VIRIDIS, signed: false, from: 1 },
  };

  // The part of the plane that is shown, mm; it depends on the design only, so that the picture stays while a load changes.
  function frame(value) {
    const D = value("D"), L = value("L"), low = L - D / 2 - value("l0"), three = value("hall_layout") === "three";
    const beside = three ? value("f") + 1.2 : Math.abs(value("chip_x")) + 1.2;
    return { half: Math.max(0.98 * D, beside), low: Math.min(0, low, three ? low + value("c") : low) - 0.13 * D, high: L + 0.2 * D };
  }

  const union = (a, b) => (b ? { half: Math.max(a.half, b.half), low: Math.min(a.low, b.low), high: Math.max(a.high, b.high) } : a);

  // From mm to pixels of the canvas; the colour bar has its own room on the right.
  function transform(canvas, view) {
    const ratio = Format.pixels(), width = canvas.width - ROOM * ratio, height = canvas.height;
    const scale = Math.min(width / (2 * view.half), (height - 16 * ratio) / (view.high - view.low));
    return { ratio, scale, x: (v) => width / 2 + v * scale, z: (v) => height / 2 + ((view.high + view.low) / 2 - v) * scale, cx: width / 2 };
  }

  // Ends of the colours: round numbers; single corner values beyond the 99th percentile do not stretch the scale.
  function range(section, name) {
    const values = section.fields[name], { signed, from } = FIELDS[name];
    const sizes = Float64Array.from(values, (v) => (signed ? Math.abs(v) : v - from)).sort();
    const most = Format.round(Math.max(sizes[Math.floor(0.99 * (sizes.length - 1))] || 0, 1e-6)), largest = sizes[sizes.length - 1];
    return { low: signed ? -most : from, high: from + most, beyond: largest > most * 1.001 };
  }

  const wider = (a, b) => (b && b.high - b.low > a.high - a.low ? { ...b, beyond: a.beyond || b.beyond } : a);

  // A linear function over a triangle is exactly a linear gradient along its slope.
  function triangles(pen, at, section, name, span, mesh) {
    const { points, triangles: cells, fields } = section, value = fields[name], map = FIELDS[name].map;
    const share = (v) => (v - span.low) / (span.high - span.low), css = (s) => { const [r, g, b] = Format.mix(map, s); return `rgb(${r | 0},${g | 0},${b | 0})`; };
    const ink = Format.colour("--soft");
    pen.lineJoin = "round";
    for (const [i, j, k] of cells) {
      const x = [at.x(points[i][0]), at.x(points[j][0]), at.x(points[k][0])], z = [at.z(points[i][1]), at.z(points[j][1]), at.z(points[k][1])];
      const s = [share(value[i]), share(value[j]), share(value[k])], low = Math.min(...s), high = Math.max(...s);
      let paint = css((low + high) / 2);
      if (high - low > FLAT) {
        const [ux, uz, vx, vz, a, b] = [x[1] - x[0], z[1] - z[0], x[2] - x[0], z[2] - z[0], s[1] - s[0], s[2] - s[0]], det = ux * vz - uz * vx;
        const gx = (a * vz - b * uz) / det, gz = (b * ux - a * vx) / det, size = gx * gx + gz * gz;
        if (isFinite(size) && size > 0) {
          const to = (t) => [x[0] + ((t - s[0]) * gx) / size, z[0] + ((t - s[0]) * gz) / size];
          const gradient = pen.createLinearGradient(...to(low), ...to(high)), stops = Math.min(9, 1 + Math.ceil((high - low) * 16));
          for (let n = 0; n <= stops; n++) gradient.addColorStop(n / stops, css(low + ((high - low) * n) / stops));
          paint = gradient;
        }
      }
      pen.beginPath(); pen.moveTo(x[0], z[0]); pen.lineTo(x[1], z[1]); pen.lineTo(x[2], z[2]); pen.closePath();
      pen.fillStyle = paint; pen.fill();
      // neighbours overlap by a hair, so that no ground shines through between them
      pen.strokeStyle = mesh ? ink : paint; pen.lineWidth = mesh ? 0.5 * at.ratio : 0.9; pen.stroke();
    }
  }

  // Edges that belong to one triangle only.
  function outline(section) {
    const edges = new Map(), n = section.points.length;
    for (const cell of section.triangles) for (let k = 0; k < 3; k++) {
      const a = cell[k], b = cell[(k + 1) % 3], key = a < b ? a * n + b : b * n + a;
      if (edges.has(key)) edges.set(key, null); else edges.set(key, [a, b]);
    }
    return [...edges.values()].filter(Boolean);
  }

  function strokeEdges(pen, at, points, edges) {
    pen.beginPath();
    for (const [a, b] of edges) { pen.moveTo(at.x(points[a][0]), at.z(points[a][1])); pen.lineTo(at.x(points[b][0]), at.z(points[b][1])); }
    pen.stroke();
  }

  function polygon(pen, at, points) {
    pen.beginPath();
    points.forEach(([x, z], k) => (k ? pen.lineTo(at.x(x), at.z(z)) : pen.moveTo(at.x(x), at.z(z))));
    pen.closePath();
  }

  // The plate: a slab above its lower face, which passes through (x, z) and falls towards +x at a positive tilt.
  function plate(pen, at, { x = 0, z, tilt = 0 }, half, dashed) {
    const angle = (tilt * Math.PI) / 180, ratio = at.ratio;
    pen.save();
    pen.translate(at.x(x), at.z(z)); pen.rotate(angle);
    const w = half * at.scale, h = 13 * ratio;
    if (dashed) {
      pen.setLineDash([5 * ratio, 4 * ratio]); pen.strokeStyle = Format.colour("--s1"); pen.lineWidth = 1.6 * ratio;
      pen.beginPath(); pen.moveTo(-w, 0); pen.lineTo(w, 0); pen.stroke();
    } else {
      pen.fillStyle = Format.colour("--plate"); pen.fillRect(-w, -h, 2 * w, h);
      pen.strokeStyle = Format.colour("--ink"); pen.lineWidth = 1.5 * ratio; pen.beginPath(); pen.moveTo(-w, 0); pen.lineTo(w, 0); pen.stroke();
    }
    pen.restore();
  }

  function ground(pen, at, D, view) {
    const z = at.z(0), w = Math.min(1.5 * D * 0.5, view.half) * at.scale, r = at.ratio;
    pen.strokeStyle = Format.colour("--soft"); pen.lineWidth = 1.5 * r;
    pen.beginPath(); pen.moveTo(at.cx - w, z); pen.lineTo(at.cx + w, z); pen.stroke();
    pen.lineWidth = r;
    pen.beginPath();
    for (let x = -w; x < w - 4 * r; x += 9 * r) { pen.moveTo(at.cx + x + 6 * r, z); pen.lineTo(at.cx + x, z + 6 * r); }
    pen.stroke();
  }

  function elements(pen, at, value) {
    const low = value("L") - value("D") / 2 - value("l0"), r = at.ratio;
    const list = value("hall_layout") === "three" ? [["S1", 0, low], ["S2", value("f"), low + value("c")]] : [["chip", value("chip_x"), low]];
    pen.font = `${11 * r}px system-ui, sans-serif`; pen.textBaseline = "middle"; pen.textAlign = "left";
    for (const [name, x, z] of list) {
      pen.fillStyle = Format.colour("--s3"); pen.fillRect(at.x(x) - 4 * r, at.z(z) - 2.5 * r, 8 * r, 5 * r);
      pen.fillStyle = Format.colour("--ink"); pen.fillText(name, at.x(x) + 7 * r, at.z(z));
    }
  }

  function bar(pen, canvas, at, name, span) {
    const r = at.ratio, { label, map } = FIELDS[name], x = canvas.width - (ROOM - 14) * r, top = 26 * r, height = Math.min(canvas.height - 52 * r, 220 * r);
    const gradient = pen.createLinearGradient(0, top + height, 0, top);
    map.forEach((rgb, k) => gradient.addColorStop(k / (map.length - 1), `rgb(${rgb.join(",")})`));
    pen.fillStyle = gradient; pen.fillRect(x, top, BAR * r, height);
    pen.fillStyle = Format.colour("--ink"); pen.font = `${11 * r}px system-ui, sans-serif`; pen.textAlign = "left"; pen.textBaseline = "middle";
    for (let k = 0; k <= 4; k++) {
      const v = span.low + ((span.high - span.low) * k) / 4, text = String(Number(v.toPrecision(3))).replace("-", "−");
      pen.fillText(k === 4 && span.beyond ? `≥ ${text}` : text, x + (BAR + 5) * r, top + height * (1 - k / 4));
    }
    pen.textAlign = "right"; pen.textBaseline = "alphabetic";
    pen.fillText(label, canvas.width - 4 * r, 12 * r);
  }

  function lines(pen, at, list, view) {
    pen.save();
    pen.beginPath(); pen.rect(at.x(-view.half), at.z(view.high), 2 * view.half * at.scale, (view.high - view.low) * at.scale); pen.clip();
    pen.strokeStyle = Format.colour("--lines"); pen.lineWidth = 1.1 * at.ratio;
    for (const line of list) { pen.beginPath(); line.forEach(([x, z], k) => (k ? pen.lineTo(at.x(x), at.z(z)) : pen.moveTo(at.x(x), at.z(z)))); pen.stroke(); }
    pen.restore();
  }

  // Draws all of one side; `wish` is the plate that was asked for, and `value` returns fields of the design.
  function draw(canvas, { state, field, span, view, mesh, fieldLines, value, wish }) {
    const pen = canvas.getContext("2d"), at = transform(canvas, view), r = at.ratio;
    pen.clearRect(0, 0, canvas.width, canvas.height);
    ground(pen, at, value("D"), view);
    if (state) {
      const { section } = state, edges = outline(section);
      triangles(pen, at, section, field, span, mesh);
      pen.lineWidth = r; pen.setLineDash([3 * r, 3 * r]); pen.strokeStyle = Format.colour("--soft");
      strokeEdges(pen, at, section.rest, edges);
      pen.setLineDash([]); pen.strokeStyle = Format.colour("--ink"); pen.lineWidth = 1.2 * r;
      strokeEdges(pen, at, section.points, edges);
      if (section.magnet?.length) {
        polygon(pen, at, section.magnet); pen.fillStyle = Format.colour("--magnet"); pen.fill(); pen.strokeStyle = Format.colour("--ink"); pen.stroke();
      }
    }
    if (fieldLines) lines(pen, at, fieldLines, view);
    elements(pen, at, value);
    if (state) plate(pen, at, state.section.plate, 0.62 * value("D"), false);
    if (wish) plate(pen, at, wish, 0.62 * value("D"), true);
    if (state) bar(pen, canvas, at, field, span);
    return at;
  }

  return { draw, frame, union, range, wider, FIELDS };
})();
