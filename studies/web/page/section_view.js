"use strict";
// The section of each side, and its plate: pointer and arrow keys move it, down and up the depth, sideways the shear.

const SectionView = (() => {
  const FINE = 0.01;
  const STEP = 0.05;
  const WIDE = 0.5;
  // steps of depth and shear
  const KEYS = {
    ArrowDown: [1, 0],
    ArrowUp: [-1, 0],
    ArrowRight: [0, 1],
    ArrowLeft: [0, -1],
    PageDown: [10, 0],
    PageUp: [-10, 0],
  };
  const tidy = (v) => Number(v.toPrecision(9));

  // `move(depth, shear, done)` sets the load; `load()` returns the present one.
  function start(figure, { load, move, value }) {
    const canvas = figure.querySelector("canvas");
    const handle = figure.querySelector(".plate");
    const caption = (name) => figure.querySelector(`figcaption .${name}`);
    const mark = Format.make("div", { class: "wish", hidden: true }, handle.parentNode);
    let at = null;
    let held = null;
    let way = 1;
    let shown = null;

    handle.addEventListener("pointerdown", (event) => {
      if (event.button) return;
      const { depth, shear } = load();
      held = { x: event.clientX, y: event.clientY, depth, shear };
      handle.setPointerCapture(event.pointerId);
      handle.classList.add("held");
      handle.focus({ preventScroll: true });
      event.preventDefault();
    });
    handle.addEventListener("pointermove", (event) => {
      if (!held || !at) return;
      const moved = (pixels) => (pixels * at.ratio) / at.scale;
      const step = (v) => Math.round(v / FINE) * FINE;
      const depth = step(held.depth + moved(event.clientY - held.y));
      move(Math.max(0, depth), step(held.shear + way * moved(event.clientX - held.x)), false);
    });
    handle.addEventListener("lostpointercapture", () => {
      held = null;
      handle.classList.remove("held");
      const { depth, shear } = load();
      move(depth, shear, true);
    });
    handle.addEventListener("keydown", (event) => {
      const { depth, shear } = load();
      const by = event.shiftKey ? WIDE : STEP;
      const [down, aside] = KEYS[event.key] || [0, 0];
      if (event.key === "Home") move(0, 0, true);
      else if (!KEYS[event.key] || event.ctrlKey || event.metaKey || event.altKey) return;
      else move(Math.max(0, tidy(depth + down * by)), tidy(shear + way * aside * by), true);
      event.preventDefault();
    });

    // Where the present load puts the plate. The section lies along the line of the shear, which runs towards +x: a
    // shear that points the other way moves the plate to the left.
    function wanted({ x, z, depth: reached }, [c, s]) {
      const { depth, shear, direction, friction, plate_tilt: tilt } = load();
      const angle = (direction * Math.PI) / 180;
      way = Math.cos(angle) * c + Math.sin(angle) * s < -0.5 ? -1 : 1;
      return { z: z + reached - depth, x: friction === "none" ? x : way * shear, tilt };
    }

    // Puts an element over a plate, some pixels above its lower face.
    function over(node, plate, above) {
      node.hidden = !at || !plate;
      if (node.hidden) return;
      const half = (0.62 * value("D") * at.scale) / at.ratio;
      const x = at.x(plate.x) / at.ratio - half;
      const y = at.z(plate.z) / at.ratio - above;
      node.style.width = `${2 * half}px`;
      node.style.transform = `translate(${x}px, ${y}px) rotate(${plate.tilt}deg)`;
    }

    // A dashed line where the plate is to go, above the picture, which a move of the hand then leaves as it is; the
    // handle lies over the drawn plate and a little below it.
    function wish() {
      const present = shown?.plate;
      const target = present && wanted(present, shown.direction);
      const far =
        present && (Math.hypot(target.z - present.z, target.x - present.x) > 0.004 || target.tilt !== present.tilt);
      over(mark, far && target, 0);
      over(handle, held ? target : present, 26);
      const [depth, shear] = [load().depth, load().shear].map(Format.plain);
      handle.setAttribute("aria-valuetext", `depth ${depth} mm, shear ${shear} mm`);
      handle.setAttribute("aria-valuemax", Format.plain(Math.max(value("L"), load().depth)));
      handle.setAttribute("aria-valuenow", depth);
    }

    return {
      canvas,
      wish,
      draw(drawing) {
        const [width, height] = [canvas.clientWidth, canvas.clientHeight].map((v) => Math.round(v * Format.pixels()));
        if (!width || !height) return;
        shown = drawing.section;
        // setting a size clears the canvas
        if (!shown || canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
        if (shown) at = SectionDrawing.draw(canvas, { ...drawing, D: value("D") });
        wish();
      },
      say({ chip, ...texts }) {
        caption("chip").dataset.level = chip;
        for (const [name, text] of Object.entries({ chip, ...texts })) Format.put(caption(name), text);
      },
    };
  }

  return { start };
})();
