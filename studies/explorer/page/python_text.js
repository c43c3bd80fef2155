// Numbers as Python's formats print them, so that sentences are the same as those of the command line.
"use strict";

const PythonText = (() => {
  /** A number as f"{value:.{digits}g}" prints it. */
  function general(value, digits = 6) {
    if (Number.isNaN(value)) return "nan";
    if (!Number.isFinite(value)) return value > 0 ? "inf" : "-inf";
    if (value === 0) return Object.is(value, -0) ? "-0" : "0";
    const [mantissa, power] = halfEven(value, digits).toExponential(digits - 1).split("e");
    const exponent = Number(power);
    if (exponent < -4 || exponent >= digits) {
      const size = String(Math.abs(exponent)).padStart(2, "0");
      return `${trimmed(mantissa)}e${exponent < 0 ? "-" : "+"}${size}`;
    }
    return trimmed(Number(`${mantissa}e${power}`).toFixed(Math.max(digits - 1 - exponent, 0)));
  }

  /** The value, or the even neighbour where it lies exactly between two numbers of so many digits. */
  function halfEven(value, digits) {
    const [mantissa, power] = value.toExponential(60).split("e"), exact = mantissa.replace(/[-.]/g, "");
    if (!/^50*$/.test(exact.slice(digits)) || Number(exact[digits - 1]) % 2) return value;
    return Math.sign(value) * Number(`${exact.slice(0, digits)}e${Number(power) - digits + 1}`);
  }

  function trimmed(text) {
    return text.includes(".") ? text.replace(/\.?0+$/, "") : text;
  }

  return { general };
})();
