// The command line and the Python lines that give a state by finite elements: studies/explorer/state_commands.py.
"use strict";

const StateCommands = (() => {
  /** A value as it is typed: the shortest text that is read back exactly. */
  function plain(value) {
    if (typeof value !== "number") return value;
    const size = Math.abs(value);
    if (size === 0 || (size >= 1e-4 && size < 1e16)) return String(value);
    const [mantissa, power] = value.toExponential().split("e");
    return `${mantissa}e${power[0]}${power.slice(1).padStart(2, "0")}`;
  }

  const literal = (value) => (typeof value === "string" ? `"${value}"` : plain(value));
  const quoted = (text) => (/^[\w@%+=:,./-]+$/.test(text) ? text : `'${text.replace(/'/g, `'"'"'`)}'`);

  /** Both texts for a checked state; `specs` are the fields of a design with their defaults. */
  function commands({ preset, design, load, motion, magnet, level }, specs) {
    const changed = specs.map(({ name }) => name).filter((name, i) => design[name] !== specs[i].default);
    return { shell: shell({ preset, design, load, motion, magnet, level }, changed), python: python({ preset, design, load, magnet, level }, changed) };
  }

  function shell({ preset, design, load, motion, magnet, level }, changed) {
    const options = [
      ["--depth", load.depth], ["--shear", load.shear_x || null], ["--shear-y", load.shear_y || null],
      ["--plate-tilt", motion.plate_tilt || null],
      ["--friction", load.shear || load.coulomb !== null ? load.friction : null],
      ["--magnet", magnet === "rigid" ? null : magnet], ["--accuracy", level === "standard" ? null : level],
    ];
    const words = ["magtip", "solve", preset];
    for (const [name, value] of options) {
      if (value === null) continue;
      const text = plain(value);
      words.push(...(text.startsWith("-") ? [`${name}=${text}`] : [name, text]));
    }
    for (const name of changed) words.push("--set", `${name}=${plain(design[name])}`);
    return words.map(quoted).join(" ");
  }

  function python({ preset, design, load, magnet, level }, changed) {
    const accuracy = level.toUpperCase(), fields = changed.map((name) => `, ${name}=${literal(design[name])}`).join("");
    const parts = [["depth", 0], ["shear_x", 0], ["shear_y", 0], ["friction", "none"], ["plate_tilt", 0]]
      .filter(([name, rest]) => load[name] !== rest).map(([name]) => `${name}=${literal(load[name])}`);
    const hasMagnet = design.magnet_diameter > 0, lines = [
      fields ? "from dataclasses import replace\n" : "",
      hasMagnet ? "from analytic import hall" : "",
      `from fem.accuracy import ${accuracy}`,
      "from fem.equilibrium import solve",
      `from geometry.design import ${preset}`,
      "from geometry.loads import Load\n",
      fields ? `design = replace(${preset}()${fields})` : `design = ${preset}()`,
      `state = solve(design, Load(${parts.join(", ")}), ${accuracy}${magnet === "rigid" ? "" : `, magnet="${magnet}"`})`,
      "print(state.status, state.message)",
      "print(state.response)",
      hasMagnet ? "print(hall.readings(design, state.response).output)" : "",
    ];
    return lines.filter(Boolean).map((line) => `${line}\n`).join("");
  }

  return { commands };
})();
