"use strict";
// The deformed sensor in 3D: WebGL, or a canvas in 2D where there is none. A drag or the arrow keys turn it.

const Deformed = (() => {
  // viridis at nine places: readable with any colour vision, and in grey
  const MAP = [
    [68, 1, 84],
    [71, 45, 123],
    [59, 82, 139],
    [44, 114, 142],
    [33, 145, 140],
    [39, 173, 129],
    [92, 200, 99],
    [170, 220, 50],
    [253, 231, 37],
  ];
  const GREY = [150, 152, 156];
  const SHOWN = { open: ["back", "cut", "magnet"], whole: ["back", "front"] };
  const START = { yaw: 0.5, pitch: 0.32 };

  function colour(share) {
    const at = Math.max(0, Math.min(1, share)) * (MAP.length - 1);
    const k = Math.min(Math.floor(at), MAP.length - 2);
    const t = at - k;
    return MAP[k].map((v, i) => v + t * (MAP[k + 1][i] - v));
  }

  // Triangles of the shown parts: points, normals and colours of their corners.
  function gather(data, mode) {
    const place = [];
    const normal = [];
    const tint = [];
    const value = [];
    for (const name of SHOWN[mode]) {
      const part = data.parts[name];
      if (!part) continue;
      const p = part.points;
      const t = part.triangles;
      const n = new Float32Array(p.length);
      for (let k = 0; k < t.length; k += 3) {
        const [a, b, c] = [3 * t[k], 3 * t[k + 1], 3 * t[k + 2]];
        const u = [p[b] - p[a], p[b + 1] - p[a + 1], p[b + 2] - p[a + 2]];
        const v = [p[c] - p[a], p[c + 1] - p[a + 1], p[c + 2] - p[a + 2]];
        const w = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
        for (const q of [a, b, c]) for (let i = 0; i < 3; i++) n[q + i] += w[i];
      }
      for (const q of t) {
        const size = Math.hypot(n[3 * q], n[3 * q + 1], n[3 * q + 2]) || 1;
        const rgb = name === "magnet" ? GREY : colour(part.value[q] / data.largest);
        for (let i = 0; i < 3; i++) {
          place.push(p[3 * q + i]);
          normal.push(n[3 * q + i] / size);
          tint.push(rgb[i] / 255);
        }
        value.push(part.value[q]);
      }
    }
    return { place: new Float32Array(place), normal: new Float32Array(normal), tint: new Float32Array(tint), value };
  }

  function bounds(data) {
    const low = [Infinity, Infinity, Infinity];
    const high = [-Infinity, -Infinity, -Infinity];
    for (const part of Object.values(data.parts))
      for (let k = 0; k < part.points.length; k++) {
        low[k % 3] = Math.min(low[k % 3], part.points[k]);
        high[k % 3] = Math.max(high[k % 3], part.points[k]);
      }
    const centre = low.map((v, i) => (v + high[i]) / 2);
    return { centre, radius: Math.hypot(...high.map((v, i) => (v - low[i]) / 2)) };
  }

  // Rows of the view: right, up, towards the viewer. Yaw turns about z; the view begins from the cut side, y < 0.
  function rotation({ yaw, pitch }) {
    const [c, s, a, b] = [Math.cos(yaw), Math.sin(yaw), Math.cos(pitch), Math.sin(pitch)];
    return [
      [c, s, 0],
      [-s * b, c * b, a],
      [s * a, -c * a, b],
    ];
  }

  const VERTEX =
    "attribute vec3 p,n,t;uniform mat3 r;uniform vec3 c;uniform vec2 k;varying vec3 vn,vt;" +
    "void main(){vec3 q=r*(p-c);vn=r*n;vt=t;gl_Position=vec4(q.x*k.x,q.y*k.y,-q.z*min(k.x,k.y)*.4,1.);}";
  const FRAGMENT =
    "precision mediump float;varying vec3 vn,vt;void main(){vec3 n=normalize(vn);" +
    "float l=.62+.38*abs(dot(n,normalize(vec3(.3,.45,.85))));gl_FragColor=vec4(vt*l,1.);}";

  function webgl(canvas) {
    const gl = canvas.getContext("webgl", { antialias: true, preserveDrawingBuffer: true, alpha: true });
    if (!gl) return null;
    const program = gl.createProgram();
    for (const [kind, text] of [
      [gl.VERTEX_SHADER, VERTEX],
      [gl.FRAGMENT_SHADER, FRAGMENT],
    ]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, text);
      gl.compileShader(shader);
      gl.attachShader(program, shader);
    }
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS)) return null;
    gl.useProgram(program);
    gl.enable(gl.DEPTH_TEST);
    const buffers = ["p", "n", "t"].map((name) => [gl.getAttribLocation(program, name), gl.createBuffer()]);
    let count = 0;
    return {
      load(mesh) {
        [mesh.place, mesh.normal, mesh.tint].forEach((array, k) => {
          const [at, buffer] = buffers[k];
          gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
          gl.bufferData(gl.ARRAY_BUFFER, array, gl.STATIC_DRAW);
          gl.enableVertexAttribArray(at);
          gl.vertexAttribPointer(at, 3, gl.FLOAT, false, 0, 0);
        });
        count = mesh.place.length / 3;
      },
      draw(rows, centre, zoom) {
        gl.viewport(0, 0, canvas.width, canvas.height);
        gl.clearColor(0, 0, 0, 0);
        gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
        gl.uniformMatrix3fv(
          gl.getUniformLocation(program, "r"),
          false,
          [0, 1, 2].flatMap((i) => rows.map((row) => row[i])),
        );
        gl.uniform3fv(gl.getUniformLocation(program, "c"), centre);
        gl.uniform2f(gl.getUniformLocation(program, "k"), (2 * zoom) / canvas.width, (2 * zoom) / canvas.height);
        gl.drawArrays(gl.TRIANGLES, 0, count);
      },
    };
  }

  // Triangles from far to near, each in one colour.
  function painter(canvas) {
    const pen = canvas.getContext("2d", { willReadFrequently: true });
    let mesh = null;
    return {
      load(next) {
        mesh = next;
      },
      draw([right, up, near], centre, zoom) {
        const { place: p, normal: m, tint } = mesh;
        const n = p.length / 3;
        const x = new Float32Array(n);
        const y = new Float32Array(n);
        const depth = new Float32Array(n / 3);
        for (let k = 0; k < n; k++) {
          const a = p[3 * k] - centre[0];
          const b = p[3 * k + 1] - centre[1];
          const c = p[3 * k + 2] - centre[2];
          x[k] = canvas.width / 2 + zoom * (right[0] * a + right[1] * b + right[2] * c);
          y[k] = canvas.height / 2 - zoom * (up[0] * a + up[1] * b + up[2] * c);
          depth[Math.floor(k / 3)] += near[0] * a + near[1] * b + near[2] * c;
        }
        // the light of the shader, in the frame of the body
        const lamp = [0, 1, 2].map((j) => 0.3 * right[j] + 0.45 * up[j] + 0.84 * near[j]);
        pen.clearRect(0, 0, canvas.width, canvas.height);
        for (const t of Uint32Array.from(depth.keys()).sort((a, b) => depth[a] - depth[b])) {
          const k = 3 * t;
          const q = 3 * k;
          const light = 255 * (0.62 + 0.38 * Math.abs(lamp[0] * m[q] + lamp[1] * m[q + 1] + lamp[2] * m[q + 2]));
          const [red, green, blue] = [0, 1, 2].map((j) => Math.round(light * tint[q + j]));
          pen.fillStyle = pen.strokeStyle = `rgb(${red},${green},${blue})`;
          pen.beginPath();
          pen.moveTo(x[k], y[k]);
          pen.lineTo(x[k + 1], y[k + 1]);
          pen.lineTo(x[k + 2], y[k + 2]);
          pen.closePath();
          pen.fill();
          pen.stroke();
        }
      },
    };
  }

  function start(data, box) {
    const canvas = box.querySelector("canvas");
    const bar = box.querySelector(".scale-bar");
    const label = box.querySelector(".scale-text");
    const { centre, radius } = bounds(data);
    const view = { ...START };
    let mode = "open";
    let painting = webgl(canvas);
    let mesh = null;
    box.dataset.renderer = painting ? "webgl" : "canvas";
    // a canvas that was asked for WebGL without success still gives a 2D context
    if (!painting) painting = painter(canvas);
    const zoom = () => (1.12 * Math.min(canvas.width, canvas.height)) / 2 / radius;
    let asked = false;
    // several turns between two frames are drawn once
    function draw() {
      if (asked) return;
      asked = true;
      requestAnimationFrame(() => {
        asked = false;
        painting.draw(rotation(view), centre, zoom());
      });
    }
    function load() {
      mesh = gather(data, mode);
      painting.load(mesh);
      draw();
    }
    function resize() {
      const ratio = Math.min(window.devicePixelRatio || 1, 2);
      const frame = canvas.getBoundingClientRect();
      if (!frame.width) return;
      canvas.width = Math.round(frame.width * ratio);
      canvas.height = Math.round(frame.height * ratio);
      const perPixel = zoom() / ratio;
      const rough = 70 / perPixel;
      const power = 10 ** Math.floor(Math.log10(rough));
      const length = [1, 2, 5, 10]
        .map((m) => m * power)
        .filter((l) => l <= rough * 1.6)
        .pop();
      bar.style.width = `${length * perPixel}px`;
      label.textContent = `${Tools.show(length)} mm`;
      draw();
    }
    function turn(dx, dy) {
      view.yaw -= dx;
      view.pitch = Math.max(-1.5, Math.min(1.5, view.pitch + dy));
      draw();
    }
    let last = null;
    canvas.addEventListener("pointerdown", (event) => {
      last = [event.clientX, event.clientY];
      canvas.setPointerCapture(event.pointerId);
      Tip.hide();
    });
    canvas.addEventListener("pointerup", () => {
      last = null;
    });
    canvas.addEventListener("pointercancel", () => {
      last = null;
    });
    canvas.addEventListener("pointerleave", () => Tip.hide());
    canvas.addEventListener("pointermove", (event) => {
      if (!last) return pick(event);
      turn((event.clientX - last[0]) * 0.011, (event.clientY - last[1]) * 0.011);
      last = [event.clientX, event.clientY];
    });
    canvas.addEventListener("keydown", (event) => {
      const moves = { ArrowLeft: [-0.12, 0], ArrowRight: [0.12, 0], ArrowUp: [0, -0.12], ArrowDown: [0, 0.12] };
      if (!moves[event.key]) return;
      event.preventDefault();
      turn(...moves[event.key]);
    });
    function pick(event) {
      const frame = canvas.getBoundingClientRect();
      const ratio = canvas.width / frame.width;
      const rows = rotation(view);
      const z = zoom() / ratio;
      const p = mesh.place;
      const at = [
        (event.clientX - frame.left - frame.width / 2) / z,
        -(event.clientY - frame.top - frame.height / 2) / z,
      ];
      let best = -1;
      let near = -Infinity;
      for (let k = 0; k < p.length / 3; k++) {
        const q = rows.map(
          (row) =>
            row[0] * (p[3 * k] - centre[0]) +
            row[1] * (p[3 * k + 1] - centre[1]) +
            row[2] * (p[3 * k + 2] - centre[2]),
        );
        if (Math.hypot(q[0] - at[0], q[1] - at[1]) < 7 / z && q[2] > near) {
          near = q[2];
          best = k;
        }
      }
      if (best < 0) return Tip.hide();
      const where = [0, 1, 2].map((i) => Tools.show(p[3 * best + i], 3)).join(", ");
      Tip.show(
        [`displacement: ${Tools.show(mesh.value[best], 3)} mm`, `at x, y, z: ${where} mm`],
        event.clientX,
        event.clientY,
      );
    }
    const button = box.querySelector("[data-open]");
    button.addEventListener("click", () => {
      mode = mode === "open" ? "whole" : "open";
      button.textContent = mode === "open" ? "Show whole" : "Cut open";
      load();
    });
    box.querySelector("[data-reset]").addEventListener("click", () => {
      Object.assign(view, START);
      draw();
    });
    box.querySelector(".colours").style.background =
      `linear-gradient(to right, ${MAP.map((rgb) => `rgb(${rgb.join(",")})`).join(",")})`;
    load();
    resize();
    new ResizeObserver(resize).observe(canvas);
  }

  function rows(data) {
    const out = [["part", "x (mm)", "y (mm)", "z (mm)", "displacement (mm)"]];
    for (const [name, part] of Object.entries(data.parts))
      part.value.forEach((v, k) => out.push([name, ...part.points.slice(3 * k, 3 * k + 3), v]));
    return out;
  }

  return { start, rows };
})();
