"use strict";
// The section of each side, and its plate: pointer and arrow keys move it, down and up the depth, sideways the shear.

const SectionView = (() => {
  const FINE = 0.01, STEP = 0.05, WIDE = 0.5;

  // `move(depth, shear, done)` sets the load; `load()` returns the present one.
  function start(figure, { load, move, value }) {
    const canvas = figure.querySelector("canvas"), handle = figure.querySelector(".plate"), caption = figure.querySelector("figcaption");
    let at = null, held = null;

    handle.addEventListener("pointerdown", (event) => {
      if (event.button) return;
      const { depth, shear } = load();
      held = { x: event.clientX, y: event.clientY, depth, shear };
      handle.setPointerCapture(event.pointerId); handle.classList.add("held"); handle.focus({ preventScroll: true });
      event.preventDefault();
    });
    handle.addEventListener("pointermove", (event) => {
      if (!held || !at) return;
      const perPixel = at.ratio / at.scale, step = (v) => Math.round(v / FINE) * FINE;
      move(Math.max(0, step(held.depth + (event.clientY - held.y) * perPixel)), step(held.shear + (event.clientX - held.x) * perPixel), false);
    });
    const release = () => {
      if (!held) return;
      held = null; handle.classList.remove("held");
      const { depth, shear } = load();
      move(depth, shear, true);
    };
    handle.addEventListener("pointerup", release);
    handle.addEventListener("pointercancel", release);
    handle.addEventListener("lostpointercapture", release);
    handle.addEventListener("keydown", (event) => {
      const way = { ArrowDown: [1, 0], ArrowUp: [-1, 0], ArrowRight: [0, 1], ArrowLeft: [0, -1], PageDown: [10, 0], PageUp: [-10, 0] }[event.key];
      const { depth, shear } = load(), by = event.shiftKey ? WIDE : STEP, tidy = (v) => Number(v.toPrecision(9));
      if (event.key === "Home") { event.preventDefault(); return move(0, 0, true); }
      if (!way || event.ctrlKey || event.metaKey || event.altKey) return;
      event.preventDefault();
      move(Math.max(0, tidy(depth + way[0] * by)), tidy(shear + way[1] * by), true);
    });

    // The handle lies over the drawn plate and a little below it.
    function place(plate) {
      if (!at || !plate) { handle.hidden = true; return; }
      const half = 0.62 * value("D") * at.scale, x = (at.x(plate.x || 0) - half) / at.ratio, y = at.z(plate.z) / at.ratio;
      handle.hidden = false;
      Object.assign(handle.style, { left: `${x}px`, width: `${(2 * half) / at.ratio}px`, top: `${y - 26}px`, transform: `rotate(${plate.tilt || 0}deg)` });
      const { depth, shear } = load(), text = `depth ${Format.plain(depth)} mm, shear ${Format.plain(shear)} mm`;
      handle.setAttribute("aria-valuetext", text); handle.setAttribute("aria-valuenow", Format.plain(depth));
    }

    return {
      canvas,
      draw(drawing) {
        Format.fit(canvas);
        if (!canvas.width) return;
        const present = drawing.state?.section.plate, { depth, shear } = load(), target = { ...present, z: value("L") - depth, x: shear };
        const far = present && (Math.abs(target.z - present.z) > 0.004 || Math.abs(target.x - (present.x || 0)) > 0.004);
        at = SectionDrawing.draw(canvas, { ...drawing, value, wish: far && !target.tilt ? target : null });
        place(present && (held && !target.tilt ? target : present));
      },
      say(text) { Format.put(caption, text); },
      grey(yes) { figure.classList.toggle("stale", yes); },
    };
  }

  return { start };
})();
