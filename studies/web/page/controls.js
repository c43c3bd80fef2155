"use strict";
// Sliders, number fields and choices, from the list of fields; each with its unit, and with the sentence that
// refuses it.

const Controls = (() => {
  const STEPS = 1000;
  const OPEN = ["Array", "Load", "Beam", "Magnet"];

  // The control of one field: show(value, all) writes into it, refuse(text) puts a sentence below it.
  function row(field, parent, change) {
    const { make, plain } = Format;
    const id = `field-${field.name}`;
    const unit = field.unit ? `, ${field.unit}` : "";
    const box = make("div", { class: `control ${field.kind}`, "data-name": field.name }, parent);
    make("label", { for: id, title: field.help }, box, field.label);
    const tell = make("p", { class: "refusal", id: `${id}-refusal`, hidden: true });
    const common = { id, "aria-describedby": tell.id };
    const set = (value, done) => change(field, value, done);
    const parts = {
      choice: () => choice(),
      part: () => choice(),
      friction: () => friction(),
      number: () => ranged(),
      logarithmic: () => ranged(),
      text: () => entry(),
    }[field.kind]();
    box.appendChild(tell);

    function choice() {
      const select = make("select", common, box);
      for (const name of field.choices)
        make("option", { value: name, disabled: name === "" }, select, name || "own values");
      select.addEventListener("change", () => set(select.value, true));
      return {
        show: (value) => {
          select.value = value;
        },
        nodes: [select],
      };
    }

    function entry() {
      const text = make("input", { ...common, type: "text", spellcheck: "false" }, box);
      text.addEventListener("change", () => set(text.value.trim(), true));
      return {
        show: (value) => {
          if (document.activeElement !== text) text.value = value;
        },
        nodes: [text],
      };
    }

    function ranged(read = (value) => value, allowed = () => true) {
      const slider = make("input", { type: "range", id: `${id}-slider`, "aria-label": `${field.label}${unit}` }, box);
      const text = make("input", { ...common, type: "text", inputmode: "decimal", spellcheck: "false" }, box);
      make("span", { class: "unit" }, box, field.unit);
      const log = field.kind === "logarithmic";
      let [low, high] = field.slider;
      let value = field.value;
      const toSlider = (v) => (log ? (STEPS * Math.log(v / low)) / Math.log(high / low) : v);
      const fromSlider = (v) =>
        Number((log ? Number((low * (high / low) ** (v / STEPS)).toPrecision(3)) : v).toPrecision(9));
      function limits() {
        Object.assign(slider, log ? { min: 0, max: STEPS, step: 1 } : { min: low, max: high, step: field.step });
      }
      function show(next) {
        value = read(next);
        if (!isFinite(value)) return;
        // a value beyond the slider's usual range makes the slider longer
        [low, high] = [
          log && value <= 0 ? field.slider[0] : Math.min(field.slider[0], value),
          Math.max(field.slider[1], value),
        ];
        limits();
        slider.value = toSlider(value);
        slider.setAttribute("aria-valuetext", `${plain(value)} ${field.unit}`);
        if (document.activeElement !== text) text.value = plain(value);
      }
      slider.addEventListener("input", () => {
        if (allowed()) set(fromSlider(Number(slider.value)), false);
      });
      slider.addEventListener("change", () => set(fromSlider(Number(slider.value)), true));
      function typed(done) {
        const entry = text.value.trim().replace(",", ".").replace("−", "-");
        const next = Number(entry);
        if (entry === "" || !isFinite(next)) {
          if (done) text.value = plain(value);
          return;
        }
        if (next !== value || done) set(next, done);
      }
      text.addEventListener("input", () => typed(false));
      text.addEventListener("change", () => typed(true));
      text.addEventListener("blur", () => {
        text.value = plain(value);
      });
      text.addEventListener("keydown", (event) => {
        const way = { ArrowUp: 1, ArrowDown: -1 }[event.key];
        if (!way) return;
        event.preventDefault();
        const next = Number((value + way * field.step * (event.shiftKey ? 10 : 1)).toPrecision(9));
        set(next, true);
        text.value = plain(next);
      });
      return { show, nodes: [slider, text] };
    }

    // none, stick, or a coefficient with its own slider
    function friction() {
      const select = make("select", common, box);
      const inner = make("div", { class: "control number coefficient", hidden: true });
      for (const name of field.choices) make("option", { value: name }, select, name);
      let last = 0.5;
      const number = row(
        { ...field, kind: "number", name: "coefficient", label: "Coefficient", value: last },
        inner,
        (_, value, done) => {
          last = value;
          set(value, done);
        },
      );
      select.addEventListener("change", () => set(select.value === "coefficient" ? last : select.value, true));
      parent.appendChild(inner);
      return {
        show(value) {
          select.value = typeof value === "number" ? "coefficient" : value;
          inner.hidden = typeof value !== "number";
          if (typeof value === "number") {
            last = value;
            number.show(value);
          }
        },
        nodes: [select],
      };
    }

    return {
      field,
      box,
      show: parts.show,
      refuse(text) {
        if (tell.textContent === (text || "")) return;
        tell.hidden = !text;
        Format.put(tell, text || "");
        for (const node of parts.nodes)
          if (text) node.setAttribute("aria-invalid", "true");
          else node.removeAttribute("aria-invalid");
      },
    };
  }

  // A field without effect in the present choices is not shown.
  const matters = (field, value) => Object.entries(field.needs).every(([name, need]) => need.includes(value(name)));

  // The part of the catalogue whose values a design has; "" for values of its own.
  const near = (a, b) => a === b || Math.abs(a - b) < 1e-6 * Math.abs(b);
  const partOf = ({ sets }, value) =>
    Object.keys(sets).find((name) => Object.entries(sets[name]).every(([key, one]) => near(value(key), one))) ?? "";

  function build(fields, parent, change) {
    const rows = new Map();
    const groups = new Map();
    const shown = new Map();
    for (const field of fields.filter((one) => !one.fixed)) {
      if (!groups.has(field.group)) {
        const group = Format.make("details", { class: "group", open: OPEN.includes(field.group) }, parent);
        Format.make("summary", {}, group, field.group);
        groups.set(field.group, group);
      }
      rows.set(field.name, row(field, groups.get(field.group), change));
    }
    return {
      show(value) {
        for (const [name, { field, box, show }] of rows) {
          const hidden = !matters(field, value);
          const next = field.sets ? partOf(field, value) : value(name);
          if (box.hidden !== hidden) box.hidden = hidden;
          // what is unchanged is not written: that would cost a layout of the page at every move of the hand
          if (shown.get(name) !== next || field.sets) {
            shown.set(name, next);
            show(next);
          }
        }
      },
      refuse(name, text) {
        for (const [own, one] of rows) one.refuse(own === name ? text : "");
        if (rows.has(name) && text) reveal(name);
        return rows.has(name);
      },
    };
    function reveal(name) {
      rows.get(name).box.closest("details").open = true;
    }
  }

  return { build };
})();
