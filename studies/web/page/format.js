"use strict";
// Numbers as text, elements, and the colour maps.

const Format = (() => {
  const map = (text) => text.split(" ").map((hex) => [0, 2, 4].map((k) => parseInt(hex.slice(k, k + 2), 16)));
  // viridis at nine places: readable with any colour vision, and in grey
  const VIRIDIS = map("440154 472d7b 3b528b 2c728e 21918c 27ad81 5cc863 aadc32 fde725");
  // signed values: blue below zero, orange above
  const SIGNED = map("084594 4292c6 9ecae1 deebf7 f5f3ee fee0c2 fdae61 e06a1b 993404");

  // Four digits, a true minus sign, powers of ten where the value is very small or large.
  function number(value, digits = 4) {
    if (value === null || value === undefined || !isFinite(value)) return "–";
    const size = Math.abs(value);
    if (size < 1e-9) return "0";
    const text =
      size >= 1e5 || size < 1e-5 ? value.toExponential(Math.max(digits - 2, 0)) : value.toPrecision(digits);
    return (text.includes("e") && size < 1e5 && size >= 1e-5 ? String(Number(text)) : text).replace(/-/g, "−");
  }

  // A number as a sentence has it: no digits that are zero, powers of ten where it is very small or large.
  function short(value, digits = 4) {
    if (value === null || value === undefined || !isFinite(value)) return "–";
    const size = Math.abs(value);
    if (value === 0 || (size < 1e5 && size >= 1e-3))
      return String(Number(value.toPrecision(digits))).replace(/^-/, "−");
    const [mantissa, power] = value.toExponential(digits - 1).split("e");
    const raised = String(Number(power)).replace(/./g, (c) => (c === "-" ? "⁻" : "⁰¹²³⁴⁵⁶⁷⁸⁹"[c]));
    return `${Number(mantissa)} × 10${raised}`.replace(/^1 × /, "").replace(/^-/, "−");
  }

  // A half width with two digits, or the text in its place.
  const width = (value) => (typeof value === "number" ? `± ${number(value, 2)}` : (value ?? ""));

  // A value in an input: as short as possible, with a decimal point in every locale.
  const plain = (value) => String(Number(Number(value).toPrecision(6)));

  function mix(map, share) {
    const at = Math.max(0, Math.min(1, share)) * (map.length - 1);
    const k = Math.min(Math.floor(at), map.length - 2);
    const t = at - k;
    return map[k].map((v, i) => v + t * (map[k + 1][i] - v));
  }

  function make(name, attributes = {}, parent = null, text = undefined) {
    const node = document.createElement(name);
    for (const [key, value] of Object.entries(attributes)) {
      if (value === true) node.setAttribute(key, "");
      else if (value !== false && value !== null && value !== undefined) node.setAttribute(key, value);
    }
    if (text !== undefined) node.textContent = text;
    if (parent) parent.appendChild(node);
    return node;
  }

  // A text that is set only where it differs: a reader of the screen is not told the same twice.
  function put(node, text) {
    if (node.textContent !== text) node.textContent = text;
  }

  // Notes of several sides as one text, [name, note] each; a note that all of them share stands once, without a name.
  function once(notes) {
    const same = notes.every(([, note]) => note === notes[0][1]);
    return same
      ? notes[0]?.[1] || ""
      : notes
          .filter(([, note]) => note)
          .map(([name, note]) => name + note)
          .join(" ");
  }

  // A colour of the style sheet in the present theme.
  const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
  const pixels = () => Math.min(window.devicePixelRatio || 1, 2);

  const TYPES = { float32: Float32Array, uint16: Uint16Array, uint32: Uint32Array, int16: Int16Array };
  // Reviver of JSON: {type: text}, base64 in little-endian order, becomes its array, times a scale where it has one.
  function unpacked(_, value) {
    const type = value && typeof value === "object" ? Object.keys(value).find((key) => key in TYPES) : null;
    if (!type || typeof value[type] !== "string") return value;
    const text = atob(value[type]);
    const bytes = new Uint8Array(text.length);
    for (let i = 0; i < text.length; i++) bytes[i] = text.charCodeAt(i);
    const array = new TYPES[type](bytes.buffer);
    return value.scale ? Float32Array.from(array, (v) => v * value.scale) : array;
  }

  return { unpacked, VIRIDIS, SIGNED, number, short, width, plain, mix, make, put, once, colour, pixels };
})();
