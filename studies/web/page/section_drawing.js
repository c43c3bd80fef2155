"use strict";
// Drawing of a deformed section on a canvas: colours, outlines, magnet, plate, Hall elements, field lines, colour bar.

const SectionDrawing = (() => {
  const TONES = 1024;
  const BAR = 12;
  const ROOM = 74;
  const FIELDS = {
    displacement: { label: "displacement (mm)", map: Format.VIRIDIS, signed: false, from: 0 },
    pressure: { label: "pressure (MPa)", map: Format.SIGNED, signed: true, from: 0 },
    stretch: { label: "largest stretch", map: Format.VIRIDIS, signed: false, from: 1 },
  };

  // The part of the plane that is shown, mm; it depends on the design, so that the picture stays while the load
  // changes.
  function frame(value) {
    const D = value("D");
    const L = value("L");
    const low = L - D / 2 - value("l0");
    const three = value("hall_layout") === "three";
    const beside = three ? value("f") + 1.2 : Math.abs(value("chip_x")) + 1.2;
    // a shear beyond a quarter of the diameter makes the picture wider
    return {
      half: Math.max(0.8 * D, beside, 0.55 * D + Math.abs(value("shear"))),
      low: Math.min(0, low, three ? low + value("c") : low) - 0.13 * D,
      high: L + 0.2 * D,
    };
  }

  const union = (a, b) =>
    b ? { half: Math.max(a.half, b.half), low: Math.min(a.low, b.low), high: Math.max(a.high, b.high) } : a;

  // From mm to pixels of the canvas; the colour bar has its own room on the right.
  function transform(canvas, view) {
    const ratio = Format.pixels();
    const width = canvas.width - ROOM * ratio;
    const height = canvas.height;
    const scale = Math.min(width / (2 * view.half), (height - 16 * ratio) / (view.high - view.low));
    return {
      ratio,
      scale,
      x: (v) => width / 2 + v * scale,
      z: (v) => height / 2 + ((view.high + view.low) / 2 - v) * scale,
      cx: width / 2,
    };
  }

  // Ends of the colours: round numbers; single corner values beyond the 99th percentile do not stretch the scale.
  function range(section, name) {
    const values = section.fields[name];
    const { signed, from } = FIELDS[name];
    const sizes = Float64Array.from(values, (v) => (signed ? Math.abs(v) : v - from)).sort();
    const most = Format.round(Math.max(sizes[Math.floor(0.99 * (sizes.length - 1))] || 0, 1e-2));
    const largest = sizes[sizes.length - 1];
    return { low: signed ? -most : from, high: from + most, beyond: largest > most * 1.001 };
  }

  const wider = (a, b) => (b && b.high - b.low > a.high - a.low ? { ...b, beyond: a.beyond || b.beyond } : a);

  // Colours of 1024 shares as pixels.
  const tables = new Map();
  function table(map) {
    if (!tables.has(map))
      tables.set(
        map,
        Uint32Array.from({ length: TONES }, (_, k) => {
          const [r, g, b] = Format.mix(map, k / (TONES - 1)).map(Math.round);
          return (255 << 24) | (b << 16) | (g << 8) | r;
        }),
      );
    return tables.get(map);
  }

  // The field, linear in each triangle, pixel by pixel: no seams between neighbours, whatever their size.
  function colours(pen, at, section, name, span) {
    const { points, triangles, fields } = section;
    const value = fields[name];
    const { width, height } = pen.canvas;
    const lut = table(FIELDS[name].map);
    const image = pen.createImageData(width, height);
    const pixel = new Uint32Array(image.data.buffer);
    const n = points.length / 2;
    const x = new Float64Array(n);
    const y = new Float64Array(n);
    const s = new Float64Array(n);
    for (let k = 0; k < n; k++) {
      x[k] = at.x(points[2 * k]) - 0.5;
      y[k] = at.z(points[2 * k + 1]) - 0.5;
      s[k] = ((value[k] - span.low) / (span.high - span.low)) * (TONES - 1);
    }
    for (let c = 0; c < triangles.length; c += 3) {
      const cell = triangles.subarray(c, c + 3);
      const [i, j, k] = cell;
      const ux = x[j] - x[i];
      const uy = y[j] - y[i];
      const vx = x[k] - x[i];
      const vy = y[k] - y[i];
      const det = ux * vy - uy * vx;
      if (!det) continue;
      const sx = ((s[j] - s[i]) * vy - (s[k] - s[i]) * uy) / det;
      const sy = ((s[k] - s[i]) * ux - (s[j] - s[i]) * vx) / det;
      const first = Math.max(0, Math.ceil(Math.min(y[i], y[j], y[k])));
      const last = Math.min(height - 1, Math.floor(Math.max(y[i], y[j], y[k])));
      for (let row = first; row <= last; row++) {
        // where the row enters and leaves the triangle
        let from = Infinity;
        let to = -Infinity;
        for (let corner = 0; corner < 3; corner++) {
          const a = cell[corner];
          const b = cell[corner === 2 ? 0 : corner + 1];
          if ((row - y[a]) * (row - y[b]) > 0 || y[a] === y[b]) continue;
          const cross = x[a] + ((row - y[a]) * (x[b] - x[a])) / (y[b] - y[a]);
          from = Math.min(from, cross);
          to = Math.max(to, cross);
        }
        const end = Math.min(width - 1, Math.floor(to));
        for (let column = Math.max(0, Math.ceil(from)); column <= end; column++) {
          const tone = s[i] + sx * (column - x[i]) + sy * (row - y[i]);
          pixel[row * width + column] = lut[tone < 0 ? 0 : tone > TONES - 1 ? TONES - 1 : tone | 0];
        }
      }
    }
    pen.putImageData(image, 0, 0);
  }

  function meshLines(pen, at, { points, triangles }) {
    pen.strokeStyle = Format.colour("--paper");
    pen.globalAlpha = 0.45;
    pen.lineWidth = 0.6 * at.ratio;
    const edges = Array.from(triangles, (i, k) => [i, triangles[k % 3 < 2 ? k + 1 : k - 2]]).flat();
    strokeEdges(pen, at, points, edges);
    pen.globalAlpha = 1;
  }

  // Edges, each of two numbers of points.
  function strokeEdges(pen, at, points, edges) {
    pen.beginPath();
    edges.forEach((n, k) => {
      const place = [at.x(points[2 * n]), at.z(points[2 * n + 1])];
      if (k % 2) pen.lineTo(...place);
      else pen.moveTo(...place);
    });
    pen.stroke();
  }

  function polygon(pen, at, points) {
    pen.beginPath();
    points.forEach(([x, z], k) => (k ? pen.lineTo(at.x(x), at.z(z)) : pen.moveTo(at.x(x), at.z(z))));
    pen.closePath();
  }

  // The plate: a slab above its lower face, which passes through (x, z) and falls towards +x at a positive tilt.
  function plate(pen, at, { x = 0, z, tilt = 0 }, half) {
    const angle = (tilt * Math.PI) / 180;
    const ratio = at.ratio;
    pen.save();
    pen.translate(at.x(x), at.z(z));
    pen.rotate(angle);
    const w = half * at.scale;
    const h = 13 * ratio;
    pen.fillStyle = Format.colour("--plate");
    pen.fillRect(-w, -h, 2 * w, h);
    pen.strokeStyle = Format.colour("--ink");
    pen.lineWidth = 1.5 * ratio;
    pen.beginPath();
    pen.moveTo(-w, 0);
    pen.lineTo(w, 0);
    pen.stroke();
    pen.restore();
  }

  function ground(pen, at, D) {
    const z = at.z(0);
    const w = 0.56 * D * at.scale;
    const r = at.ratio;
    pen.strokeStyle = Format.colour("--soft");
    pen.lineWidth = 1.5 * r;
    pen.beginPath();
    pen.moveTo(at.cx - w, z);
    pen.lineTo(at.cx + w, z);
    pen.stroke();
    pen.lineWidth = r;
    pen.beginPath();
    for (let x = -w; x < w - 4 * r; x += 9 * r) {
      pen.moveTo(at.cx + x + 6 * r, z);
      pen.lineTo(at.cx + x, z + 6 * r);
    }
    pen.stroke();
  }

  // Hall elements, seen along the normal of the section; one outside of its plane is hollow.
  function elements(pen, at, { elements: places, direction: [c, s] }) {
    const r = at.ratio;
    pen.font = `${11 * r}px system-ui, sans-serif`;
    pen.textBaseline = "middle";
    pen.textAlign = "left";
    for (const [name, [x, y, z]] of Object.entries(places)) {
      const place = [at.x(c * x + s * y) - 4 * r, at.z(z) - 2.5 * r, 8 * r, 5 * r];
      pen.fillStyle = pen.strokeStyle = Format.colour("--s3");
      pen.lineWidth = 1.3 * r;
      if (Math.abs(c * y - s * x) < 0.01) pen.fillRect(...place);
      else pen.strokeRect(...place);
      pen.lineWidth = 3 * r;
      pen.strokeStyle = Format.colour("--paper");
      pen.strokeText(name, place[0] + 11 * r, at.z(z));
      pen.fillStyle = Format.colour("--ink");
      pen.fillText(name, place[0] + 11 * r, at.z(z));
    }
  }

  function bar(pen, canvas, at, name, span) {
    const r = at.ratio;
    const { label, map } = FIELDS[name];
    const x = canvas.width - (ROOM - 14) * r;
    const top = 26 * r;
    const height = Math.min(canvas.height - 52 * r, 220 * r);
    const gradient = pen.createLinearGradient(0, top + height, 0, top);
    map.forEach((rgb, k) => gradient.addColorStop(k / (map.length - 1), `rgb(${rgb.join(",")})`));
    pen.fillStyle = gradient;
    pen.fillRect(x, top, BAR * r, height);
    pen.fillStyle = Format.colour("--ink");
    pen.font = `${11 * r}px system-ui, sans-serif`;
    pen.textAlign = "left";
    pen.textBaseline = "middle";
    for (let k = 0; k <= 4; k++) {
      const v = span.low + ((span.high - span.low) * k) / 4;
      const text = String(Number(v.toPrecision(3))).replace("-", "−");
      pen.fillText(k === 4 && span.beyond ? `≥ ${text}` : text, x + (BAR + 5) * r, top + height * (1 - k / 4));
    }
    pen.textAlign = "right";
    pen.textBaseline = "alphabetic";
    pen.fillText(label, canvas.width - 4 * r, 12 * r);
  }

  // Lines that the magnet carries, in its own coordinates.
  function lines(pen, at, { lines: list, centre, tilt }, view) {
    pen.save();
    pen.beginPath();
    pen.rect(at.x(-view.half), at.z(view.high), 2 * view.half * at.scale, (view.high - view.low) * at.scale);
    pen.clip();
    pen.strokeStyle = Format.colour("--lines");
    pen.lineWidth = 1.1 * at.ratio;
    pen.translate(at.x(centre[0]), at.z(centre[1]));
    pen.rotate(tilt);
    for (const line of list) {
      pen.beginPath();
      for (let k = 0; k < line.length; k += 2) pen.lineTo(line[k] * at.scale, -line[k + 1] * at.scale);
      pen.stroke();
    }
    pen.restore();
  }

  // Draws all of one side; `value` returns fields of the design.
  function draw(canvas, { state, field, span, view, mesh, fieldLines, value }) {
    const pen = canvas.getContext("2d", { willReadFrequently: true });
    const at = transform(canvas, view);
    const r = at.ratio;
    if (state) colours(pen, at, state.section, field, span);
    else pen.clearRect(0, 0, canvas.width, canvas.height);
    ground(pen, at, value("D"));
    if (state) {
      const { section } = state;
      if (mesh) meshLines(pen, at, section);
      pen.lineWidth = r;
      pen.setLineDash([3 * r, 3 * r]);
      pen.strokeStyle = Format.colour("--soft");
      strokeEdges(pen, at, section.rest, section.outline);
      pen.setLineDash([]);
      pen.strokeStyle = Format.colour("--ink");
      pen.lineWidth = 1.2 * r;
      strokeEdges(pen, at, section.points, section.outline);
      if (section.magnet?.length) {
        polygon(pen, at, section.magnet);
        pen.fillStyle = Format.colour("--magnet");
        pen.fill();
        pen.strokeStyle = Format.colour("--ink");
        pen.stroke();
      }
    }
    if (fieldLines) lines(pen, at, fieldLines, view);
    if (!state) return at;
    elements(pen, at, state.section);
    plate(pen, at, state.section.plate, 0.62 * value("D"));
    bar(pen, canvas, at, field, span);
    return at;
  }

  return { draw, frame, union, range, wider, FIELDS };
})();
