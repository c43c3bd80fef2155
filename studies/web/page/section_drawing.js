"use strict";
// Drawing of a deformed section on a canvas: colours, outlines, magnet, plate, Hall elements, field lines, colour bar.

const SectionDrawing = (() => {
  const TONES = 1024;
  // share of a triangle by which rounding may leave a pixel between two of them
  const EDGE = 1e-9;
  const BAR = 12;
  const ROOM = 74;
  const colourMap = (span) => (span.low < 0 ? Format.SIGNED : Format.VIRIDIS);

  // The parts of the plane, mm, and the ends of the colours that serve both sides.
  const union = (a, b) => ({
    half: Math.max(a.half, b.half),
    low: Math.min(a.low, b.low),
    high: Math.max(a.high, b.high),
  });
  const wider = (a, b) => (b.high - b.low > a.high - a.low ? { ...b, beyond: a.beyond || b.beyond } : a);

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
    };
  }

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
  function colours(pen, at, { points, triangles, fields }, name, span) {
    const value = fields[name];
    const { width, height } = pen.canvas;
    const lut = table(colourMap(span));
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
      const [i, j, k] = triangles.subarray(c, c + 3);
      const ux = x[j] - x[i];
      const uy = y[j] - y[i];
      const vx = x[k] - x[i];
      const vy = y[k] - y[i];
      const det = ux * vy - uy * vx;
      if (!det) continue;
      const right = Math.min(width - 1, Math.floor(Math.max(x[i], x[j], x[k])));
      const low = Math.min(height - 1, Math.floor(Math.max(y[i], y[j], y[k])));
      for (let row = Math.max(0, Math.ceil(Math.min(y[i], y[j], y[k]))); row <= low; row++)
        for (let column = Math.max(0, Math.ceil(Math.min(x[i], x[j], x[k]))); column <= right; column++) {
          // shares of the second and the third corner
          const a = ((column - x[i]) * vy - (row - y[i]) * vx) / det;
          const b = ((row - y[i]) * ux - (column - x[i]) * uy) / det;
          if (a < -EDGE || b < -EDGE || a + b > 1 + EDGE) continue;
          const tone = s[i] + a * (s[j] - s[i]) + b * (s[k] - s[i]);
          pixel[row * width + column] = lut[Math.max(0, Math.min(TONES - 1, tone)) | 0];
        }
    }
    pen.putImageData(image, 0, 0);
  }

  // Lines through points [x, z], mm; widths and dashes in pixels.
  function trace(pen, at, lines, { colour = "--ink", width = 1, fill = "", dash = [] }) {
    pen.strokeStyle = Format.colour(colour);
    pen.lineWidth = width * at.ratio;
    pen.setLineDash(dash.map((v) => v * at.ratio));
    pen.beginPath();
    for (const line of lines) line.forEach(([x, z], k) => pen[k ? "lineTo" : "moveTo"](at.x(x), at.z(z)));
    if (fill) {
      pen.closePath();
      pen.fillStyle = Format.colour(fill);
      pen.fill();
    }
    pen.stroke();
    pen.setLineDash([]);
  }

  // Groups of a few numbers of points as lines.
  const joined = (points, numbers, few) =>
    Array.from({ length: numbers.length / few }, (_, k) =>
      Array.from(numbers.subarray(few * k, few * (k + 1)), (n) => [points[2 * n], points[2 * n + 1]]),
    );

  // From the coordinates of a body at a place, whose x axis falls by an angle, to those of the section.
  function placed([x, z], angle) {
    const [c, s] = [Math.cos(angle), Math.sin(angle)];
    return (u, v) => [x + c * u + s * v, z - s * u + c * v];
  }

  // The plate: a slab above its lower face, which passes through (x, z) and falls towards +x at a positive tilt.
  function plate(pen, at, { x, z, tilt }, half) {
    const corner = placed([x, z], (tilt * Math.PI) / 180);
    const high = (13 * at.ratio) / at.scale;
    const face = [corner(-half, 0), corner(half, 0)];
    trace(pen, at, [[...face, corner(half, high), corner(-half, high)]], { colour: "--plate", fill: "--plate" });
    trace(pen, at, [face], { width: 1.5 });
  }

  function ground(pen, at, half) {
    const pixel = at.ratio / at.scale;
    const count = Math.ceil((2 * half - 4 * pixel) / (9 * pixel));
    const hatches = Array.from({ length: count }, (_, k) => {
      const left = -half + 9 * pixel * k;
      const top = [left + 6 * pixel, 0];
      return [top, [left, -6 * pixel]];
    });
    const line = [-half, half].map((x) => [x, 0]);
    trace(pen, at, [line], { colour: "--soft", width: 1.5 });
    trace(pen, at, hatches, { colour: "--soft" });
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

  function bar(pen, canvas, at, span) {
    const r = at.ratio;
    const map = colourMap(span);
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
    pen.fillText(span.label, canvas.width - 4 * r, 12 * r);
  }

  // Lines that the magnet carries, in its own coordinates.
  function lines(pen, at, { lines: list, centre, tilt }, view) {
    const corner = placed(centre, tilt);
    pen.save();
    pen.beginPath();
    pen.rect(at.x(-view.half), at.z(view.high), 2 * view.half * at.scale, (view.high - view.low) * at.scale);
    pen.clip();
    const points = (line) => Array.from({ length: line.length / 2 }, (_, k) => corner(line[2 * k], line[2 * k + 1]));
    trace(pen, at, list.map(points), { colour: "--lines", width: 1.1 });
    pen.restore();
  }

  // Draws all of one side.
  function draw(canvas, { section, field, span, view, mesh, fieldLines, D }) {
    const pen = canvas.getContext("2d", { willReadFrequently: true });
    const at = transform(canvas, view);
    const { points, rest, triangles, outline, magnet } = section;
    colours(pen, at, section, field, span);
    ground(pen, at, 0.56 * D);
    if (mesh) {
      pen.globalAlpha = 0.45;
      const cells = joined(points, triangles, 3).map((cell) => [...cell, cell[0]]);
      trace(pen, at, cells, { colour: "--paper", width: 0.6 });
      pen.globalAlpha = 1;
    }
    trace(pen, at, joined(rest, outline, 2), { colour: "--soft", dash: [3, 3] });
    trace(pen, at, joined(points, outline, 2), { width: 1.2 });
    if (magnet.length) trace(pen, at, [magnet], { width: 1.2, fill: "--magnet" });
    if (fieldLines) lines(pen, at, fieldLines, view);
    elements(pen, at, section);
    plate(pen, at, section.plate, 0.62 * D);
    bar(pen, canvas, at, span);
    return at;
  }

  return { draw, union, wider };
})();
