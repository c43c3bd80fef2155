// Readings of the Hall elements for a displaced and tilted magnet: analytic/hall.py, parts.py and reading_noise.py in
// JavaScript. Lengths in mm, angles in rad, B in T. A pose is {shift: [x, y, z], tilt: [rx, ry]}.
"use strict";

const HallReadings = (() => {
  const AXES = [[0, 0, -1], [1, 0, 0], [0, 1, 0]];

  /** The three elements of the design's layout; `chips` and `converter` are those of analytic.parts. */
  function elements(design, { chips }) {
    const three = design.hall_layout === "three", s1 = design.L - design.D / 2 - design.l0, s23 = s1 + design.c;
    const chip = chips[design.hall_layout], place = [design.chip_x, 0, s1];
    const positions = three ? [[0, 0, s1], [design.f, 0, s23], [0, design.f, s23]] : [place, place, place];
    const common = three
      ? {
        gain: design.hall_gain, rest: design.hall_null, low: design.hall_low, high: design.hall_high, unit: "V",
        noise: Math.hypot(design.hall_noise, design.hall_noise_density * Math.sqrt(design.hall_bandwidth)),
        step: design.hall_step, plate: design.hall_plate, floor: design.hall_noise_floor,
      }
      : {
        gain: 1, rest: 0, low: -chip.range, high: chip.range, unit: "T", noise: chip.noise, step: chip.step, plate: 0,
        floor: 0,
      };
    const names = three ? ["S1", "S2", "S3"] : ["chip -z", "chip x", "chip y"];
    return names.map((name, i) => ({
      ...common, name, position: positions[i], direction: AXES[i], average: Math.trunc(design.hall_average),
    }));
  }

  /** The elements, with the paper's converter if they have no noise and send V; and whether it is assumed. */
  function withNoise(chosen, { converter }) {
    if (chosen.some(({ noise, step, floor }) => noise || step || floor)) return chosen;
    return chosen.map((one) => (one.unit === "V" ? { ...one, ...converter } : one));
  }

  /** The standard deviation of a reading, T. */
  function noiseOf({ noise, step, floor, average, gain }) {
    const bias = roundingBias(noise, step), one = Math.hypot(noise, step / Math.sqrt(12));
    return Math.hypot(floor, Math.sqrt(one ** 2 / average + bias ** 2 * (1 - 1 / average))) / gain;
  }

  function roundingBias(noise, step) {
    if (!step) return 0;
    const ratio = noise / step;
    if (ratio < 0.1) return step * Math.sqrt(1 / 12 - ratio / Math.sqrt(Math.PI) + ratio ** 2);
    let sum = 0;
    for (let k = 9; k >= 1; k--) sum += Math.exp(-((2 * Math.PI * k * ratio) ** 2)) / (2 * Math.PI ** 2 * k ** 2);
    return step * Math.sqrt(sum);
  }

  const cross = ([a, b, c], [x, y, z]) => [b * z - c * y, c * x - a * z, a * y - b * x];

  /** A vector turned by the rotation vector (rx, ry, 0). */
  function turned(vector, [rx, ry]) {
    const angle = Math.hypot(rx, ry), half = angle / 2, axis = [rx, ry, 0];
    const first = angle ? Math.sin(angle) / angle : 1, second = angle ? (Math.sin(half) / half) ** 2 / 2 : 0.5;
    const along = rx * vector[0] + ry * vector[1], side = cross(axis, vector), cosine = Math.cos(angle);
    return vector.map((v, i) => v * cosine + first * side[i] + second * along * axis[i]);
  }

  /** B (3) at a point of the sensor's frame. */
  function fieldAt(point, design, { shift, tilt }, poles) {
    const centre = [shift[0], shift[1], shift[2] + design.L - design.D / 2];
    const [x, y, z] = turned(point.map((v, i) => v - centre[i]), [-tilt[0], -tilt[1]]);
    const J = poles[design.magnet_north] * design.remanence;
    // half a turn about x from the magnet's frame to the sensor's: the north pole points down
    const b = CylinderField.field(x, -y, -z, design.magnet_diameter / 2, design.magnet_height, J);
    return b && turned([b[0], -b[1], -b[2]], tilt);
  }

  /** The points at which an element samples the field: its centre, or the 2 x 2 Gauss points of its plate. */
  function plate({ position, direction, plate: side }) {
    if (!side) return [position];
    const sizes = direction.map(Math.abs), least = sizes.indexOf(Math.min(...sizes));
    const raw = cross(direction, [0, 1, 2].map((i) => (i === least ? 1 : 0)));
    const aside = raw.map((v) => (v * side) / (2 * Math.sqrt(3) * Math.hypot(...raw))), across = cross(direction, aside);
    const signs = [[-1, -1], [-1, 1], [1, -1], [1, 1]];
    return signs.map(([i, j]) => position.map((v, k) => v + i * aside[k] + j * across[k]));
  }

  /** B.n of each element, T, and its slopes along the pose's five coordinates are taken by the caller. */
  function fields(chosen, design, pose, poles) {
    return chosen.map((element) => {
      const points = plate(element);
      const sum = points.reduce((all, point) => {
        const b = fieldAt(point, design, pose, poles);
        return all + b[0] * element.direction[0] + b[1] * element.direction[1] + b[2] * element.direction[2];
      }, 0);
      return sum / points.length;
    });
  }

  /** Half to even, as NumPy rounds. */
  function rounded(value) {
    const nearest = Math.round(value);
    return nearest - value === 0.5 && nearest % 2 ? nearest - 1 : nearest;
  }

  /** The output of an element, in V or T, from B.n: rounded to whole steps and within the rails. */
  function output({ gain, rest, low, high, step }, b) {
    const raw = rest + gain * b, whole = step > 0 ? rounded(raw / step) * step : raw;
    return { value: Math.min(Math.max(whole, low), high), saturated: raw <= low || raw >= high };
  }

  return { elements, withNoise, noiseOf, fieldAt, fields, output };
})();
