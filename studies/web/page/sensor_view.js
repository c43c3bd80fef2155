"use strict";
// The deformed sensor in 3D by three: a drag or the arrow keys turn it; both sides turn together.

const SensorView = (() => {
  const SHOWN = { open: ["back", "cut", "magnet"], whole: ["back", "front"] };
  const START = { yaw: 0.5, pitch: 0.32 };
  const GREY = [150, 153, 156];
  const KEYS = { ArrowLeft: [0.12, 0], ArrowRight: [-0.12, 0], ArrowUp: [0, -0.12], ArrowDown: [0, 0.12] };
  const PER_PIXEL = 0.011;

  // `tint` gives the colour of a value, as it appears on the screen; three calculates with linear light.
  function geometry({ points, value, triangles }, tint) {
    const colours = new Float32Array(points.length);
    const colour = new THREE.Color();
    value.forEach((one, k) => colour.setRGB(...tint(one).map((part) => part / 255), "srgb").toArray(colours, 3 * k));
    const shape = new THREE.BufferGeometry();
    shape.setAttribute("position", new THREE.BufferAttribute(Float32Array.from(points), 3));
    shape.setAttribute("color", new THREE.BufferAttribute(colours, 3));
    shape.setIndex(new THREE.BufferAttribute(Uint32Array.from(triangles), 1));
    shape.computeVertexNormals();
    return shape;
  }

  function start(figure, view, turned) {
    const canvas = figure.querySelector("canvas");
    const scene = new THREE.Scene();
    const camera = new THREE.OrthographicCamera(-1, 1, 1, -1, 0.1, 100);
    const lamp = new THREE.DirectionalLight(0xffffff, 1.9);
    const material = new THREE.MeshLambertMaterial({ vertexColors: true, side: THREE.DoubleSide });
    const body = new THREE.Group();
    camera.up.set(0, 0, 1);
    camera.add(lamp);
    lamp.position.set(0.3, 0.45, 0.85);
    scene.add(camera, new THREE.AmbientLight(0xffffff, 1.7), body);
    let parts = [];
    let renderer = null;
    try {
      renderer = new THREE.WebGLRenderer({ canvas, antialias: true, alpha: true, preserveDrawingBuffer: true });
    } catch {
      canvas.hidden = true;
      const text = "The picture in 3D needs WebGL, which this browser does not offer.";
      Format.make("p", { class: "soft" }, figure, text);
    }
    figure.dataset.renderer = renderer ? "webgl" : "none";

    // `scale` is the half height of the picture in mm, the same for both sides.
    function draw(scale, height) {
      const { clientWidth, clientHeight } = canvas;
      if (!renderer || !parts.length || !clientWidth) return;
      const ratio = Format.pixels();
      const wide = clientWidth / clientHeight;
      if (renderer.getPixelRatio() !== ratio) renderer.setPixelRatio(ratio);
      const size = renderer.getSize(new THREE.Vector3());
      if (size.x !== clientWidth || size.y !== clientHeight) renderer.setSize(clientWidth, clientHeight, false);
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

    function show(data, largest, mode) {
      for (const mesh of body.children) mesh.geometry.dispose();
      body.clear();
      body.rotation.z = data.turn ?? 0;
      parts = SHOWN[mode].map((name) => data.parts[name]).filter(Boolean);
      for (const part of parts) {
        const tint = part === data.parts.magnet ? () => GREY : (value) => Format.mix(Format.VIRIDIS, value / largest);
        body.add(new THREE.Mesh(geometry(part, tint), material));
      }
    }

    // The point of what is shown that lies nearest to the viewer among those within some pixels of the pointer.
    function nearest(event, pixels) {
      const { x, y, width, height } = canvas.getBoundingClientRect();
      let best = null;
      let depth = Infinity;
      for (const { points, value } of parts)
        for (let k = 0; k < value.length; k++) {
          const point = Array.from(points.slice(3 * k, 3 * k + 3));
          const at = new THREE.Vector3(...point).applyMatrix4(body.matrixWorld).project(camera);
          const off = [x + ((1 + at.x) / 2) * width - event.clientX, y + ((1 - at.y) / 2) * height - event.clientY];
          if (Math.hypot(...off) > pixels || at.z >= depth) continue;
          depth = at.z;
          best = { point, value: value[k] };
        }
      return best;
    }

    function turn(yaw, pitch) {
      view.yaw += yaw;
      view.pitch = Math.max(-1.5, Math.min(1.5, view.pitch + pitch));
      turned();
    }
    // not movementX, which browsers do not have for every pointer
    let last = [0, 0];
    canvas.addEventListener("pointerdown", (event) => {
      last = [event.clientX, event.clientY];
      canvas.setPointerCapture(event.pointerId);
    });
    canvas.addEventListener("pointermove", (event) => {
      if (!canvas.hasPointerCapture(event.pointerId)) return;
      turn((event.clientX - last[0]) * -PER_PIXEL, (event.clientY - last[1]) * PER_PIXEL);
      last = [event.clientX, event.clientY];
    });
    canvas.addEventListener("keydown", (event) => {
      const way = KEYS[event.key];
      if (!way) return;
      event.preventDefault();
      turn(...way);
    });
    return { canvas, show, draw, nearest };
  }

  return { start, START };
})();
