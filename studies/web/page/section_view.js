"use strict";
// The section of each side, and its plate: pointer and arrow keys move it, down and up the depth, sideways the shear.

const SectionView = (() => {
  const FINE = 0.01;
  const STEP = 0.05;
  const WIDE = 0.5;

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
      const perPixel = at.ratio / at.scale;
      const step = (v) => Math.round(v / FINE) * FINE;
      move(
        Math.max(0, step(held.depth + (event.clientY - held.y) * perPixel)),
        step(held.shear + way * (event.clientX - held.x) * perPixel),
        false,
      );
    });
    const release = () => {
      if (!held) return;
      held = null;
      handle.classList.remove("held");
      const { depth, shear } = load();
      move(depth, shear, true);
    };
    handle.addEventListener("pointerup", release);
    handle.addEventListener("pointercancel", release);
    handle.addEventListener("lostpointercapture", release);
    handle.addEventListener("keydown", (event) => {
      const key = {
        ArrowDown: [1, 0],
        ArrowUp: [-1, 0],
        ArrowRight: [0, 1],
        ArrowLeft: [0, -1],
        PageDown: [10, 0],
        PageUp: [-10, 0],
      }[event.key];
      const { depth, shear } = load();
      const by = event.shiftKey ? WIDE : STEP;
      const tidy = (v) => Number(v.toPrecision(9));
      if (event.key === "Home") {
        event.preventDefault();
        return move(0, 0, true);
      }
      if (!key || event.ctrlKey || event.metaKey || event.altKey) return;
      event.preventDefault();
      move(Math.max(0, tidy(depth + key[0] * by)), tidy(shear + way * key[1] * by), true);
    });

    // Where the present load puts the plate. The section lies along the line of the shear, which runs towards +x: a
    // shear that points the other way moves the plate to the left.
    function wanted(present, [c, s]) {
      const { depth, shear, direction, friction, plate_tilt: tilt } = load();
      const angle = (direction * Math.PI) / 180;
      const along = Math.cos(angle) * c + Math.sin(angle) * s;
      const rise = (value("D") / 2) * (1 / Math.cos((tilt * Math.PI) / 180) - 1);
      way = along < -0.5 ? -1 : 1;
      return { z: value("L") - depth + rise, x: friction === "none" ? present.x : way * shear, tilt };
    }

    // Puts an element over a plate, some pixels above its lower face.
    function over(node, plate, above) {
      node.hidden = !at || !plate;
      if (node.hidden) return;
      const half = (0.62 * value("D") * at.scale) / at.ratio;
      const x = at.x(plate.x || 0) / at.ratio - half;
      const y = at.z(plate.z) / at.ratio - above;
      node.style.width = `${2 * half}px`;
      node.style.transform = `translate(${x}px, ${y}px) rotate(${plate.tilt || 0}deg)`;
    }

    // The handle lies over the drawn plate and a little below it.
    function place(plate) {
      over(handle, plate, 26);
      const { depth, shear } = load();
      const text = `depth ${Format.plain(depth)} mm, shear ${Format.plain(shear)} mm`;
      handle.setAttribute("aria-valuetext", text);
      handle.setAttribute("aria-valuemax", Format.plain(Math.max(value("L"), depth)));
      handle.setAttribute("aria-valuenow", Format.plain(depth));
    }

    // A dashed line where the plate is to go, above the picture, which a move of the hand then leaves as it is.
    function wish() {
      const { plate: present, direction = [1, 0] } = shown || {};
      const target = present && wanted(present, direction);
      const far =
        present && (Math.hypot(target.z - present.z, target.x - present.x) > 0.004 || target.tilt !== present.tilt);
      over(mark, far && target, 0);
      place(present && (held ? target : present));
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
      say({ chip, time, text }) {
        Format.put(caption("chip"), chip);
        caption("chip").dataset.level = chip;
        Format.put(caption("time"), time);
        Format.put(caption("text"), text);
      },
    };
  }

  return { start };
})();
