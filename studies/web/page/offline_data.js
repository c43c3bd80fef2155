// Data in JSON, of the page without a server and of the server's answers, in which arrays of numbers are texts of
// base64 in little-endian order.
"use strict";

const OfflineData = (() => {
  const TYPES = {
    float64: Float64Array,
    float32: Float32Array,
    int16: Int16Array,
    uint16: Uint16Array,
    uint32: Uint32Array,
  };

  /** The value with each {type: text} replaced by its array. */
  function decoded(value) {
    if (Array.isArray(value)) return value.map(decoded);
    if (value === null || typeof value !== "object") return value;
    const entries = Object.entries(value);
    if (entries.length === 1 && entries[0][0] in TYPES) {
      const text = atob(entries[0][1]);
      const bytes = new Uint8Array(text.length);
      for (let i = 0; i < text.length; i++) bytes[i] = text.charCodeAt(i);
      return new TYPES[entries[0][0]](bytes.buffer);
    }
    return Object.fromEntries(entries.map(([key, one]) => [key, decoded(one)]));
  }

  return { decoded };
})();
