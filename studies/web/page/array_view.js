"use strict";
// An array from above: a disc for each beam, arrows for forces along the plate. A click or an arrow key chooses a beam.

const ArrayView = (() => {
  const WIDTH = 400;
  const LEGEND = 108;
  // force along the plate that is rounding, N
  const NONE = 1e-6;
  const NAMES = { set: "as set", jointly: "decoded jointly", ignoring: "neighbours ignored" };
  const WAYS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };
  const { number, short, mix, VIRIDIS } = Format;
  const known = (force) => force.every((one) => one !== null);

  // The values that change when another beam is chosen, whose load comes from the text of the others.
  function swapped({ beam, beam_loads: text, depth, shear, direction }, next) {
    const loads = new Map(
      text
        .split(/\s+/)
        .filter(Boolean)
        .map((one) => one.split(":")),
    );
    if (depth || shear) loads.set(beam, [depth, shear, direction].join());
    else loads.delete(beam);
    const [z = 0, x = 0, turn = 0] = (loads.get(next) || "0").split(",").map(Number);
    loads.delete(next);
    const rest = [...loads].sort(([a], [b]) => a - b).map((one) => one.join(":"));
    return { beam: next, beam_loads: rest.join(" "), depth: z, shear: x, direction: turn };
  }

  // One, two or five times a power of ten, the largest one up to a value.
  function round(value) {
    const power = 10 ** Math.floor(Math.log10(value));
    return [5, 2, 1].find((one) => one * power <= value * (1 + 1e-9)) * power;
  }

  // Places in pixels, and the scales that both sides share: pixels for a newton, and the end of the colours, N.
  function measures(data, every) {
    const xs = data.places.map(([x]) => x);
    const ys = data.places.map(([, y]) => y);
    const forces = every.flatMap((one) => Object.values(one.forces).flat()).filter(known);
    const along = Math.max(...forces.map(([x, y]) => Math.hypot(x, y)).filter((size) => size > NONE), 0);
    const room = 0.75 * data.diameter;
    const [left, top] = [Math.min(...xs) - data.diameter, Math.max(...ys) + data.diameter];
    const wide = Math.max(...xs) - Math.min(...xs) + 2 * data.diameter;
    const high = Math.max(...ys) - Math.min(...ys) + 2 * data.diameter;
    const scale = Math.min(WIDTH / wide, (1.1 * WIDTH) / high);
    return {
      x: (v) => (v - left) * scale + (WIDTH - wide * scale) / 2,
      y: (v) => (top - v) * scale,
      radius: (data.diameter / 2) * scale,
      height: high * scale,
      along,
      perNewton: along > 0 ? (room * scale) / along : 0,
      end: Math.max(...forces.map(([, , z]) => z), 0),
    };
  }

  const colour = (force, { end }) =>
    force === null || !end
      ? "var(--raised)"
      : `rgb(${mix(VIRIDIS, force / end)
          .map(Math.round)
          .join()})`;

  // An arrow of pixels on a halo of paper, which a disc of any colour sets off; nothing where it is too short to see.
  // That of joint decoding lies on the one that is set.
  function arrow(name, x, y, dx, dy) {
    const size = Math.hypot(dx, dy);
    if (size < 2) return "";
    const [c, s] = [dx / size, dy / size];
    const head = Math.min(8, size / 2);
    const end = [x + dx, y + dy];
    const wing = (side) => [end[0] - head * (c - 0.55 * side * s), end[1] - head * (s + 0.55 * side * c)];
    const path = `M${x} ${y}L${end}M${wing(1)}L${end}L${wing(-1)}`.replaceAll(",", " ");
    const halo = name === "jointly" ? "" : `<path class="halo" d="${path}"/>`;
    return `${halo}<path class="${name}" d="${path}"/>`;
  }

  const spoken = (force) => {
    const [x, y, z] = force.map((one) => number(one, 3));
    return known(force) ? `${z} newtons normal, ${x} along x, ${y} along y` : "no force";
  };

  function beam(data, k, at, chosen) {
    const [x, y] = [at.x(data.places[k][0]), at.y(data.places[k][1])];
    const [set, ignored] = [data.forces.set[k], data.forces.ignoring[k]];
    const pole = data.poles[k] > 0 ? "magnet as designed" : "magnet reversed";
    const texts = Object.entries(NAMES).map(([name, words]) => `${words} ${spoken(data.forces[name][k])}`);
    const label = `Beam ${k + 1}, ${pole}: ${texts.join("; ")}`;
    const r = at.radius;
    const font = Math.max(6, Math.min(13, 0.6 * r));
    const mark = data.poles[k] > 0 ? "▲" : "▼";
    return (
      `<g role="radio" aria-checked="${chosen}" tabindex="${chosen ? 0 : -1}" data-beam="${k + 1}"` +
      ` aria-label="${label}">` +
      `<title>${label}</title><circle class="ring" cx="${x}" cy="${y}" r="${r}" fill="${colour(ignored[2], at)}"/>` +
      `<circle cx="${x}" cy="${y}" r="${0.72 * r}" fill="${colour(set[2], at)}"/>` +
      `<text x="${x - 0.66 * r}" y="${y - 0.76 * r}" font-size="${font}">${k + 1}${mark}</text></g>`
    );
  }

  function arrows(data, k, at) {
    const place = [at.x(data.places[k][0]), at.y(data.places[k][1])];
    return ["ignoring", "set", "jointly"]
      .map((name) => [name, data.forces[name][k]])
      .filter(([, force]) => known(force))
      .map(([name, [x, y]]) => arrow(name, ...place, x * at.perNewton, -y * at.perNewton))
      .join("");
  }

  function legend(at) {
    const y = at.height + 18;
    const stops = VIRIDIS.map(
      (rgb, k) => `<stop offset="${k / (VIRIDIS.length - 1)}" stop-color="rgb(${rgb.join()})"/>`,
    );
    const ticks = [0, 0.5, 1].map(
      (share) =>
        `<text x="${10 + 150 * share}" y="${y + 26}" text-anchor="middle">${short(share * at.end, 3)}</text>`,
    );
    const bar =
      `<defs><linearGradient id="normal">${stops.join("")}</linearGradient></defs>` +
      `<rect x="10" y="${y}" width="150" height="10" fill="url(#normal)"/>${ticks.join("")}` +
      `<text x="10" y="${y - 6}">normal force (N): disc as set,</text>` +
      `<text x="10" y="${y + 44}">ring with neighbours ignored</text>` +
      `<text x="10" y="${y + 84}">▲ magnet as designed, ▼ reversed</text>`;
    const lines = Object.entries(NAMES).map(
      ([name, words], k) =>
        `${arrow(name, 205, y + 8 + 18 * k, 36, 0)}<text x="248" y="${y + 12 + 18 * k}">${words}</text>`,
    );
    const sample = at.along > 0 ? round(at.along) : 0;
    const length = sample * at.perNewton;
    const scale = sample
      ? `${arrow("jointly", 205, y + 62, length, 0)}` +
        `<text x="${212 + length}" y="${y + 66}">scale: ${short(sample, 2)} N</text>`
      : "";
    const title = `<text x="205" y="${y - 6}">force along the plate: ${sample ? "arrows" : "none"}</text>`;
    return `<g class="legend" aria-hidden="true">${at.end ? bar : ""}${title}${lines.join("")}${scale}</g>`;
  }

  // The nearest beam in a direction: not farther aside than ahead.
  function beside(data, from, [wx, wy]) {
    const [x, y] = data.places[from];
    const ahead = data.places
      .map(([px, py], k) => ({ k, a: (px - x) * wx + (py - y) * wy, b: Math.abs((px - x) * wy - (py - y) * wx) }))
      .filter(({ a, b }) => a > 1e-9 && b <= a);
    return ahead.length ? ahead.reduce((best, one) => (one.a + one.b < best.a + best.b ? one : best)).k : from;
  }

  function start(figure, side) {
    let data = null;
    let drawn = "";
    const choose = (k) => Explorer.choose(side, String(k + 1));
    figure.addEventListener("click", (event) => {
      const node = event.target.closest("[data-beam]");
      if (!node) return;
      node.focus();
      choose(Number(node.dataset.beam) - 1);
    });
    figure.addEventListener("keydown", (event) => {
      const node = event.target.closest("[data-beam]");
      if (!node || event.ctrlKey || event.metaKey || event.altKey) return;
      const from = Number(node.dataset.beam) - 1;
      const ends = { Home: 0, End: data.places.length - 1, " ": from };
      if (!WAYS[event.key] && !(event.key in ends)) return;
      event.preventDefault();
      choose(WAYS[event.key] ? beside(data, from, WAYS[event.key]) : ends[event.key]);
    });

    // `every`: the data of all sides, whose scales are one; `values`: those of the page, with the chosen beam.
    return (picture, every, values) => {
      data = picture ?? null;
      if (!data) {
        drawn = "";
        figure.replaceChildren();
        return;
      }
      const at = measures(data, every);
      const numbers = data.places.map((_, k) => k);
      const text =
        `<svg viewBox="0 0 ${WIDTH} ${at.height + LEGEND + 8}"><g role="radiogroup" aria-label="Beams of the array">` +
        numbers.map((k) => beam(data, k, at, String(k + 1) === values.beam)).join("") +
        `</g><g class="arrows" aria-hidden="true">${numbers.map((k) => arrows(data, k, at)).join("")}</g>` +
        `${legend(at)}</svg>`;
      if (text === drawn) return;
      drawn = text;
      const held = figure.contains(document.activeElement);
      figure.innerHTML = text;
      if (held) figure.querySelector("[aria-checked=true]")?.focus();
    };
  }

  return { start, swapped };
})();
