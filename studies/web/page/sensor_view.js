"use strict";
// The deformed sensor in 3D by three: a drag or the arrow keys turn it; both sides turn together.

const SensorView = (() => {
  const SHOWN = { open: ["back", "cut", "magnet"], whole: ["back", "front"] };
  const START = { yaw: 0.5, pitch: 0.32 };
  const GREY = [0.59, 0.6, 0.61];

  // Colours are given as they appear on the screen; three calculates with linear light.
  const linear = (v) => (v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4);

  function geometry(data, mode, largest) {
    let points = 0;
    let corners = 0;
    const parts = SHOWN[mode].filter((name) => data.parts[name]).map((name) => [name, data.parts[name]]);
    for (const [, part] of parts) {
      points += part.points.length;
      corners += part.triangles.length;
    }
    const place = new Float32Array(points);
    const tint = new Float32Array(points);
    const index = new Uint32Array(corners);
    let at = 0;
    let to = 0;
    for (const [name, part] of parts) {
      place.set(part.points, at);
      for (let k = 0; k < part.value.length; k++) {
        const rgb =
          name === "magnet" ? GREY : Format.mix(Format.VIRIDIS, part.value[k] / largest).map((v) => v / 255);
        for (let i = 0; i < 3; i++) tint[at + 3 * k + i] = linear(rgb[i]);
      }
      for (let k = 0; k < part.triangles.length; k++) index[to + k] = part.triangles[k] + at / 3;
      at += part.points.length;
      to += part.triangles.length;
    }
    const shape = new THREE.BufferGeometry();
    shape.setAttribute("position", new THREE.BufferAttribute(place, 3));
    shape.setAttribute("color", new THREE.BufferAttribute(tint, 3));
    shape.setIndex(new THREE.BufferAttribute(index, 1));
    shape.computeVertexNormals();
    return shape;
  }

  function start(figure, view, turned) {
    const canvas = figure.querySelector("canvas");
    let renderer;
    try {
      renderer = new THREE.WebGLRenderer({ canvas, antialias: true, alpha: true, preserveDrawingBuffer: true });
    } catch {
      canvas.hidden = true;
      Format.make(
        "p",
        { class: "soft" },
        figure,
        "The picture in 3D needs WebGL, which this browser does not offer.",
      );
      figure.dataset.renderer = "none";
      return {
        canvas,
        show() {},
        draw() {},
        extent: () => ({ low: [0, 0, 0], high: [1, 1, 1] }),
        nearest() {},
        grey() {},
      };
    }
    figure.dataset.renderer = "webgl";
    const scene = new THREE.Scene();
    const camera = new THREE.OrthographicCamera(-1, 1, 1, -1, 0.1, 100);
    const lamp = new THREE.DirectionalLight(0xffffff, 1.9);
    camera.up.set(0, 0, 1);
    camera.add(lamp);
    lamp.position.set(0.3, 0.45, 0.85);
    scene.add(camera, new THREE.AmbientLight(0xffffff, 1.7));
    const material = new THREE.MeshLambertMaterial({ vertexColors: true, side: THREE.DoubleSide });
    const body = new THREE.Mesh(new THREE.BufferGeometry(), material);
    scene.add(body);
    let data = null;
    let mode = "open";

    // Ends of the box around all parts, mm.
    function extent() {
      const low = [Infinity, Infinity, Infinity];
      const high = [-Infinity, -Infinity, -Infinity];
      for (const part of Object.values(data.parts))
        for (let k = 0; k < part.points.length; k++) {
          low[k % 3] = Math.min(low[k % 3], part.points[k]);
          high[k % 3] = Math.max(high[k % 3], part.points[k]);
        }
      return { low, high };
    }

    // `scale` is the half height of the picture in mm, the same for both sides.
    function draw(scale, height) {
      if (!data || !canvas.clientWidth) return;
      const ratio = Format.pixels();
      const wide = canvas.clientWidth / canvas.clientHeight;
      if (renderer.getPixelRatio() !== ratio) renderer.setPixelRatio(ratio);
      const size = renderer.getSize(new THREE.Vector3());
      if (size.x !== canvas.clientWidth || size.y !== canvas.clientHeight)
        renderer.setSize(canvas.clientWidth, canvas.clientHeight, false);
      const half = scale / Math.min(wide, 1);
      const centre = new THREE.Vector3(0, 0, height / 2);
      const far = 10 * scale;
      Object.assign(camera, { left: -half * wide, right: half * wide, top: half, bottom: -half, far: 2 * far });
      const { yaw, pitch } = view;
      camera.position.set(
        far * Math.sin(yaw) * Math.cos(pitch),
        -far * Math.cos(yaw) * Math.cos(pitch),
        centre.z + far * Math.sin(pitch),
      );
      camera.lookAt(centre);
      camera.updateProjectionMatrix();
      renderer.render(scene, camera);
    }

    function show(next, largest, how) {
      data = next;
      mode = how;
      body.geometry.dispose();
      body.geometry = geometry(data, mode, largest);
      body.rotation.z = data.turn ?? 0;
    }

    // The point of what is shown that lies nearest to the viewer among those within some pixels of the pointer.
    function nearest(event, pixels) {
      const { x, y, width, height } = canvas.getBoundingClientRect();
      let best = null;
      let depth = Infinity;
      for (const name of SHOWN[mode]) {
        const { points = [], value } = data.parts[name] || {};
        for (let k = 0; k < points.length; k += 3) {
          const at = new THREE.Vector3(points[k], points[k + 1], points[k + 2])
            .applyMatrix4(body.matrixWorld)
            .project(camera);
          const off = [x + ((1 + at.x) / 2) * width - event.clientX, y + ((1 - at.y) / 2) * height - event.clientY];
          if (Math.hypot(...off) > pixels || at.z >= depth) continue;
          depth = at.z;
          best = { point: [points[k], points[k + 1], points[k + 2]], value: value[k / 3] };
        }
      }
      return best;
    }

    let last = null;
    canvas.addEventListener("pointerdown", (event) => {
      last = [event.clientX, event.clientY];
      canvas.setPointerCapture(event.pointerId);
    });
    for (const name of ["pointerup", "pointercancel"])
      canvas.addEventListener(name, () => {
        last = null;
      });
    canvas.addEventListener("pointermove", (event) => {
      if (!last) return;
      turn((event.clientX - last[0]) * -0.011, (event.clientY - last[1]) * 0.011);
      last = [event.clientX, event.clientY];
    });
    canvas.addEventListener("keydown", (event) => {
      const way = { ArrowLeft: [0.12, 0], ArrowRight: [-0.12, 0], ArrowUp: [0, -0.12], ArrowDown: [0, 0.12] }[
        event.key
      ];
      if (!way) return;
      event.preventDefault();
      turn(...way);
    });
    function turn(yaw, pitch) {
      view.yaw += yaw;
      view.pitch = Math.max(-1.5, Math.min(1.5, view.pitch + pitch));
      turned();
    }
    return {
      canvas,
      show,
      draw,
      extent,
      nearest,
      grey(yes) {
        figure.classList.toggle("stale", yes);
      },
    };
  }

  return { start, START };
})();
