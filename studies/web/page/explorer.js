"use strict";
// The page: values of both sides, address and history, and which answer is drawn where.

const Explorer = (() => {
  const NEAR = 0.9;
  const REST = 250;
  const MOST_UNDO = 45;
  const FIGURES = 100;
  // Choices of the view, the first one the default; those that the server answers are asked for.
  const VIEWS = {
    level: ["standard", "quick"],
    field: ["displacement", "pressure", "stretch"],
    lines: ["no", "yes"],
    mesh: ["no", "yes"],
    drawing: ["no", "yes"],
    formula: ["finite", "paper", "column", "tip", "magnet"],
    edit: ["a", "b"],
    cut: ["open", "whole"],
  };
  const ASKED = ["level", "lines", "drawing"];
  const VIEW = Object.fromEntries(Object.entries(VIEWS).map(([key, [first]]) => [key, first]));
  const inAddress = (key) => (key === "level" ? key : `view.${key}`);
  const EVERYTHING = ["layout", "controls", ...Requests.PARTS];
  const $ = (selector, root = document) => root.querySelector(selector);
  const engine = window.MAGTIP_OFFLINE ? OfflineEngine(window.MAGTIP_OFFLINE) : LiveEngine();
  const sides = { a: null, b: null };
  const answers = { a: {}, b: {} };
  const refusals = { a: null, b: null };
  const view = { ...VIEW };
  const turn = { ...SensorView.START };
  let fields = [];
  let controls = null;
  let views = null;
  let requests = null;
  let notice = "";
  let index = 0;
  let top = 0;
  let oldest = 0;
  let current = "";
  let pending = 0;
  let drawing = false;
  let later = 0;
  const dirty = new Set();
  const shownSides = () => (sides.b ? ["a", "b"] : ["a"]);
  const value = (side) => (name) => sides[side][name];
  const defaults = () => Object.fromEntries(fields.map((field) => [field.name, field.value]));

  // ---- values

  // Of a fixed design there are states at the stops of the sliders only.
  function stopped(name, value) {
    const { stops, low, high, step } = fields.find((one) => one.name === name);
    if (!stops) return value;
    return Number((Math.round(Math.max(low, Math.min(high, value)) / step) * step).toPrecision(9));
  }

  function set(side, name, next, done = true) {
    if (!sides[side]) return;
    next = stopped(name, next);
    if (sides[side][name] === next && !done) return;
    if (sides[side][name] !== next) {
      sides[side][name] = next;
      requests.change(side);
    }
    touch("controls", "wish");
    if (done) commitSoon();
  }

  const isAsked = (part) => view[part === "field_lines" ? "lines" : part] !== "no";
  const parts = () => Requests.PARTS.filter(isAsked);

  function message(side) {
    const values = sides[side];
    if (!values) return null;
    const pick = (wanted) =>
      Object.fromEntries(fields.filter(wanted).map((field) => [field.name, values[field.name]]));
    const design = pick((field) => field.scope === "design" && values[field.name] !== field.value);
    const load = pick((field) => field.scope === "load");
    const state = { design, load, magnet: values.magnet, level: view.level };
    if (values.beam) state.array = pick((field) => field.scope === "array");
    return { state, parts: parts() };
  }

  // Another beam of an array: its load takes the place of the present one, which is kept with those of the others.
  function choose(side, beam) {
    commit();
    for (const [name, one] of Object.entries(ArrayView.swapped(sides[side], beam))) set(side, name, one, false);
    commit();
  }

  // ---- address and history

  function address() {
    const parts = [];
    const add = (key, text) => parts.push(`${encodeURIComponent(key)}=${encodeURIComponent(text)}`);
    for (const side of shownSides()) {
      const prefix = side === "b" ? "b." : "";
      add(`${prefix}preset`, "paper");
      for (const field of fields)
        if (sides[side][field.name] !== field.value) add(prefix + field.name, sides[side][field.name]);
    }
    for (const [key, text] of Object.entries(view)) if (text !== VIEW[key]) add(inAddress(key), text);
    return `#${parts.join("&")}`;
  }

  function apply(hash) {
    const unknown = [];
    const read = { a: defaults(), b: null };
    const seen = { ...VIEW };
    for (const [key, text] of new URLSearchParams(hash.replace(/^#/, ""))) {
      const side = key.startsWith("b.") ? "b" : "a";
      const name = side === "b" ? key.slice(2) : key;
      const field = fields.find((one) => one.name === name);
      const choice = Object.keys(VIEWS).find((one) => inAddress(one) === key);
      if (side === "b") read.b ??= defaults();
      if (name === "preset") {
        const chosen = field?.sets?.[text];
        if (chosen) Object.assign(read[side], chosen);
        else if (text !== "paper") unknown.push(`${key}=${text}`);
      } else if (VIEWS[choice]?.includes(text)) seen[choice] = text;
      else if (!field || field.fixed) unknown.push(key);
      else if (field.choices && field.choices.includes(text) && text !== "coefficient") read[side][name] = text;
      else if (field.kind === "text") read[side][name] = text;
      else if (field.kind !== "choice" && text !== "" && isFinite(text))
        read[side][name] = stopped(name, Number(text));
      else unknown.push(`${key}=${text}`);
    }
    Object.assign(sides, read);
    Object.assign(view, seen);
    if (!sides.b) closeB();
    shownSides().forEach((side) => requests.change(side));
    say(
      unknown.length
        ? `The address has parts that this page does not know, and leaves out: ${unknown.join(", ")}.`
        : "",
    );
    touch(...EVERYTHING);
  }

  function closeB() {
    sides.b = null;
    view.edit = "a";
    answers.b = {};
    refusals.b = null;
    requests.forget("b");
  }

  const commitSoon = () => {
    clearTimeout(pending);
    pending = setTimeout(commit, REST);
  };
  function commit() {
    clearTimeout(pending);
    const hash = address();
    if (hash === current) return;
    current = hash;
    index += 1;
    top = index;
    oldest = Math.max(oldest, top - MOST_UNDO);
    history.pushState({ index }, "", hash);
    buttons();
  }
  function buttons() {
    $("#undo").disabled = index <= oldest;
    $("#redo").disabled = index >= top;
  }
  function step(by) {
    commit();
    if (by < 0 ? index > oldest : index < top) history.go(by);
  }
  window.addEventListener("popstate", (event) => {
    clearTimeout(pending);
    if (event.state && isFinite(event.state.index)) index = event.state.index;
    else {
      index += 1;
      top = index;
      history.replaceState({ index }, "");
    }
    top = Math.max(top, index);
    apply(location.hash);
    // an address from elsewhere may have its parts in another order
    current = address();
    buttons();
  });

  // ---- answers

  function show(side, part, answer) {
    answers[side][part] = answer;
    if (part === "state") refusals[side] = null;
    touch(part === "field_lines" ? "state" : part, ...(part === "state" ? ["controls"] : []));
  }
  function refuse(side, answer) {
    refusals[side] = answer;
    touch("state", "controls");
  }
  function progress(side, answer) {
    answers[side].progress = answer;
    touch("state");
  }
  function say(text) {
    notice = text;
    Format.put($("#notice"), text);
    $("#notice").hidden = !text;
  }

  // ---- drawing, once in a frame

  function touch(...what) {
    for (const one of what) dirty.add(one);
    if (drawing) return;
    drawing = true;
    requestAnimationFrame(() => {
      drawing = false;
      draw(new Set(dirty));
    });
  }

  function draw(all) {
    dirty.clear();
    if (all.has("layout")) layout();
    if (all.has("controls")) drawControls();
    if (all.has("state")) drawState();
    else if (all.has("wish")) drawWish();
    for (const name of Object.keys(views.pictures)) if (all.has(name) || all.has("controls")) drawPicture(name);
    if (all.has("sensor3d")) drawSensor(true);
    else if (all.has("turn")) drawSensor(false);
    if (all.has("state") || Requests.PARTS.some((part) => all.has(part))) {
      drawNumbers();
      // the picture comes first, and next to a hand that moves figures follow some times a second
      later ||= setTimeout(drawFigures, FIGURES);
    }
    if (all.has("commands")) {
      for (const node of document.querySelectorAll("[data-command]"))
        Format.put(node, answers[view.edit].commands?.data[node.dataset.command] || "");
      const names = shownSides().map((side) => answers[side].commands?.data.sensor || "");
      Format.put($("#sensor-name"), sides.b ? `A: ${names[0]} · B: ${names[1]}` : names[0]);
    }
    for (const panel of document.querySelectorAll(".panel[data-part]")) {
      const waits = shownSides().some((side) => !refusals[side] && requests.behind(side, panel.dataset.part));
      Format.put($(".state", panel), waits ? "updating" : "");
    }
  }

  function layout() {
    document.body.classList.toggle("compare", Boolean(sides.b));
    for (const figure of document.querySelectorAll("figure[data-side=b]")) figure.hidden = !sides.b;
    $("#edit").hidden = !sides.b;
    $("#compare").setAttribute("aria-pressed", String(Boolean(sides.b)));
    $("#cut").setAttribute("aria-pressed", String(view.cut === "open"));
    for (const input of document.querySelectorAll("[name=edit]")) input.checked = input.value === view.edit;
    for (const [key, text] of Object.entries(view)) {
      const node = $(`#view-${key}`);
      const yes = text === "yes";
      if (node) Object.assign(node, node.matches("details") ? { open: yes } : { checked: yes, value: text });
    }
  }

  function drawControls() {
    const side = view.edit;
    const refusal = refusals[side];
    controls.show(value(side));
    controls.refuse(refusal?.field, refusal?.error);
  }

  function drawState() {
    const list = shownSides();
    const sections = list.map((side) => answers[side].state?.data.section);
    const drawn = sections.filter(Boolean);
    const common = drawn.length && {
      field: view.field,
      mesh: view.mesh === "yes",
      span: drawn.map((section) => section.spans[view.field]).reduce(SectionDrawing.wider),
      view: drawn.map((section) => section.frame).reduce(SectionDrawing.union),
    };
    list.forEach((side, k) => {
      const one = views.sections[side];
      const fieldLines = view.lines === "yes" ? answers[side].field_lines?.data : null;
      one.draw({ ...common, section: sections[k], fieldLines });
      for (const figure of document.querySelectorAll(`figure[data-side=${side}]`))
        figure.classList.toggle("stale", Boolean(refusals[side]));
      one.say(caption(side));
    });
  }

  // Before the answer: where the plate is to go, and that the solve is on its way.
  function drawWish() {
    for (const side of shownSides()) {
      views.sections[side].wish();
      views.sections[side].say(caption(side));
    }
  }

  function caption(side) {
    const refusal = refusals[side];
    const answer = answers[side].state;
    const share = answers[side].progress;
    const last = answer ? "The last picture is shown in grey" : "There is no picture";
    if (refusal) return { chip: "stopped", time: "", text: `${last}: ${refusal.error}` };
    if (!answer) return { chip: "", time: "", text: notice ? "" : engine.wait || "" };
    const { status, message: text, seconds } = answer.data;
    const waits = requests.behind(side, "state");
    const own =
      share?.number === requests.newest(side) && share.progress.share > 0 && (waits || answer.level !== view.level);
    const part = own ? `, ${Math.round(100 * share.progress.share)} %` : "";
    const next = waits
      ? `; solving${part}`
      : answer.level === "quick" && view.level === "standard"
        ? `; refining to standard${part}`
        : "";
    const beam = sides[side].beam ? `Beam ${sides[side].beam}. ` : "";
    const state = beam + (status === "ok" ? "" : `Status ${status.replaceAll("_", " ")}. `);
    return {
      chip: answer.level,
      time: engine.time ?? `${Format.number(seconds, 2)} s${next}`,
      text: `${state}${text || ""}`,
    };
  }

  // A picture of a panel, with what both sides have in common.
  function drawPicture(name) {
    const data = shownSides().map((side) => answers[side][name]?.data.picture);
    shownSides().forEach((side, k) => views.pictures[name][side](data[k], data.filter(Boolean), sides[side]));
  }

  function drawSensor(changed) {
    const list = shownSides().filter((side) => answers[side].sensor3d);
    const half = ({ D, L, shear }) => 0.5 * Math.hypot(D, L) + 0.4 * Math.abs(shear);
    const size = Math.max(...shownSides().map((side) => half(sides[side])));
    const largest = Math.max(...list.map((side) => answers[side].sensor3d.data.scale));
    for (const side of list) {
      if (changed) views.sensors[side].show(answers[side].sensor3d.data, largest, view.cut);
      views.sensors[side].draw(size, sides[side].L);
    }
    const note = `Coloured by displacement, 0 to ${Format.plain(largest)} mm. Drag, or use the arrow keys, to turn.`;
    if (list.length) Format.put($("#sensor-note"), note);
  }

  // Tables and figures are those of the part of their panel; the press near which it may buckle gets a warning.
  function drawNumbers() {
    const list = shownSides();
    for (const [name, table] of Object.entries(views.tables)) {
      const part = table.box.closest(".panel").dataset.part;
      const found = list.map((side) => answers[side][part]?.data);
      table.show(
        list,
        found.map((data) => data?.tables?.[name] ?? (data?.rows && data)),
        view.formula,
      );
    }
    const critical = (side) => answers[side].stability?.data.critical_depth ?? NaN;
    const near = list.filter((side) => sides[side].depth > NEAR * critical(side));
    const texts = near.map((side) => {
      const where = sides[side].depth > critical(side) ? "beyond" : "near";
      const name = sides.b ? `${side.toUpperCase()}: the` : "The";
      const depth = Format.plain(sides[side].depth);
      return `${name} depth of ${depth} mm is ${where} the critical depth: the press may buckle sideways.`;
    });
    $("#near").hidden = !texts.length;
    Format.put($("#near"), texts.join(" "));
  }

  function drawFigures() {
    later = 0;
    const list = shownSides();
    const models = [undefined, "finite elements", "paper's formula", `formula ${view.formula}`];
    for (const [name, figure] of Object.entries(views.figures)) {
      const part = figure.box.closest(".panel").dataset.part;
      const found = list.filter((side) => answers[side][part]?.data.figures?.[name]);
      figure.box.hidden = !found.length;
      if (!found.length) continue;
      const series = (side) => (sides.b ? side.toUpperCase() : "");
      const rows = found.flatMap((side) =>
        answers[side][part].data.figures[name].rows
          .filter((row) => models.includes(row.model))
          .map((row) => ({ ...row, series: series(side) })),
      );
      const now = found
        .filter((side) => sides[side].depth > 0)
        .map((side) => ({ depth: sides[side].depth, series: series(side) }));
      const { chart, title } = answers[found[0]][part].data.figures[name];
      const spec = JSON.parse(JSON.stringify(views.charts[chart]).replaceAll("VALUE", title));
      spec.description = `${title}. Arrow keys read values.`;
      if (sides.b) spec.encoding.color.legend = { title: null };
      figure.show(spec, chart === "curve" ? { rows, now } : { rows });
    }
  }

  // Whether everything that is shown belongs to the newest requests, at the level where they rest.
  const settled = (side) =>
    parts().every((part) => !requests.behind(side, part)) &&
    (answers[side].state?.level !== "quick" || view.level === "quick") &&
    answers[side].loop?.level !== "linear";
  const complete = () =>
    requests.resting() && !drawing && shownSides().every((side) => refusals[side] || settled(side));

  // ---- start

  function look(key, next) {
    view[key] = next;
    if (ASKED.includes(key)) shownSides().forEach(requests.change);
    touch("layout", "controls", "state", "sensor3d", "curve", "commands");
    commitSoon();
  }

  function wire() {
    $("#undo").addEventListener("click", () => step(-1));
    $("#redo").addEventListener("click", () => step(1));
    document.addEventListener("keydown", (event) => {
      if (!(event.ctrlKey || event.metaKey) || event.altKey) return;
      const key = event.key.toLowerCase();
      if (key !== "z" && key !== "y") return;
      event.preventDefault();
      step(key === "z" && !event.shiftKey ? -1 : 1);
    });
    $("#compare").addEventListener("click", () => {
      if (sides.b) closeB();
      else {
        sides.b = { ...sides.a };
        view.edit = "b";
        requests.change("b");
      }
      touch(...EVERYTHING);
      commit();
    });
    for (const input of document.querySelectorAll("[name=edit]"))
      input.addEventListener("change", () => look("edit", input.value));
    for (const key of Object.keys(VIEWS))
      $(`#view-${key}`)?.addEventListener("change", ({ target }) =>
        look(key, target.type === "checkbox" ? (target.checked ? "yes" : "no") : target.value),
      );
    for (const fold of document.querySelectorAll("details[id^=view-]"))
      fold.addEventListener("toggle", () => {
        const [key, text] = [fold.id.replace("view-", ""), fold.open ? "yes" : "no"];
        if (view[key] !== text) look(key, text);
      });
    $("#cut").addEventListener("click", () => look("cut", view.cut === "open" ? "whole" : "open"));
    $("#turn-back").addEventListener("click", () => {
      Object.assign(turn, SensorView.START);
      touch("turn");
    });
    $("#reset").addEventListener("click", () => {
      sides[view.edit] = defaults();
      requests.change(view.edit);
      touch("controls", "state");
      commit();
    });
    $("#controls").addEventListener("submit", (event) => event.preventDefault());
    const watch = new ResizeObserver(() => {
      for (const one of Object.values(views.figures)) one.size();
      touch("state", "turn");
    });
    for (const box of document.querySelectorAll(".canvas-box, .sensor canvas, .chart")) watch.observe(box);
  }

  return {
    $,
    engine,
    sides,
    answers,
    view,
    refusals,
    turn,
    shownSides,
    set,
    choose,
    message,
    commit,
    commitSoon,
    show,
    refuse,
    progress,
    say,
    touch,
    wire,
    address,
    look,
    complete,
    fields: () => fields,
    requests: () => requests,
    notice: () => notice,
    resting: () => requests.resting() && !drawing,
    use(parts) {
      ({ fields, controls, views, requests } = { fields, controls, views, requests, ...parts });
    },
    begin() {
      index = history.state?.index ?? 0;
      top = index;
      oldest = index;
      history.replaceState({ index }, "");
      apply(location.hash);
      current = address();
      buttons();
    },
  };
})();
