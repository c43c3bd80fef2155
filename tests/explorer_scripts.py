"""JavaScript that drives and measures the explorer's page in tests and in `explorer_session`."""

REST = """Explorer.resting() && ['a', 'b'].every((side) =>
  !Explorer.sides[side] || Explorer.refusals[side] || Explorer.answers[side].state)"""
"""Whether the newest request of each side has its picture."""
DRAG = """(async (id, low, high, steps) => {
  const slider = document.getElementById(id), { engine } = Explorer, { receive } = Explorer.requests();
  const { ask } = engine, moves = [], sent = new Map(), times = [];
  engine.ask = (request) => {
    sent.set(request.number, performance.now());
    for (const move of moves) move.number ??= request.number;
    ask(request);
  };
  engine.on.answer = (answer) => {
    receive(answer);
    if (answer.part !== 'state' || Explorer.answers.a.state !== answer) return;
    const received = performance.now(), begin = sent.get(answer.number), [queue, work] = answer.times || [0, 0];
    // the page has asked for the same frame before
    requestAnimationFrame(() => {
      const now = performance.now();
      for (const move of moves.filter((one) => one.number <= answer.number && !one.drawn)) {
        move.drawn = true;
        times.push({ total: now - move.at, before: begin - move.at, queue, work,
          transport: received - begin - queue - work, drawing: now - received });
      }
    });
  };
  for (let k = 0; k <= steps; k++) {
    slider.value = low + (high - low) * k / steps;
    moves.push({ at: performance.now() });
    slider.dispatchEvent(new Event('input', { bubbles: true }));
    await new Promise((done) => setTimeout(done, 25));
  }
  slider.dispatchEvent(new Event('change', { bubbles: true }));
  for (let k = 0; k < 400 && !Explorer.resting(); k++) await new Promise((done) => setTimeout(done, 25));
  engine.ask = ask;
  engine.on.answer = receive;
  return times;
})"""
"""Moves a slider at 40 steps a second.

Returns the times from each step to the first picture that contains it, ms, and what they consist of: until the
request of the picture was sent, its wait for the worker, the worker's time, transport, and drawing.
"""
GO = """(async (state) => {
  Explorer.commit();
  if (location.hash === state) return;
  const gone = new Promise((done) => addEventListener('popstate', done, { once: true }));
  location.hash = state;
  await gone;
})"""
"""Goes to another state by the address; the page hears of it a little later."""
SET = """((name, value) => {
  const node = document.getElementById(`field-${name}-slider`) || document.getElementById(`field-${name}`);
  node.value = value;
  if (node.type === 'range') node.dispatchEvent(new Event('input', { bubbles: true }));
  node.dispatchEvent(new Event('change', { bubbles: true }));
})"""
"""Sets a slider or a choice as a hand does."""
TYPE = """((id, value, kind) => {
  const node = document.getElementById(id);
  node.focus();
  node.value = value;
  node.dispatchEvent(new Event(kind, { bubbles: true }));
})"""
"""Puts a text into a field, or chooses an option."""
COUNT = """(() => {
  const { engine } = Explorer, ask = engine.ask;
  window.asked = [];
  engine.ask = (request) => { window.asked.push(request.number); ask(request); };
})()"""
"""Notes the numbers of all requests from now on."""
LATE = """(() => {
  const { receive } = Explorer.requests(), now = Explorer.answers.a.state;
  const seconds = () => Explorer.answers.a.state.data.seconds;
  const other = { ...now, data: { ...now.data, seconds: -1 } };
  receive({ ...other, number: now.number - 1 });
  const late = seconds();
  receive({ ...now, level: 'standard' });
  receive({ ...other, level: 'quick' });
  const coarser = seconds();
  receive({ ...other, number: now.number + 1 });
  return [late >= 0, coarser >= 0, seconds()];
})()"""
"""Hands the page an answer to an older request, a coarser one to the present one, and a newer one."""
RATIO = """
  const style = getComputedStyle(document.documentElement);
  const pen = document.createElement('canvas').getContext('2d', { willReadFrequently: true });
  const linear = (v) => (v /= 255) <= .04045 ? v / 12.92 : ((v + .055) / 1.055) ** 2.4;
  const light = (name) => {
    pen.fillStyle = style.getPropertyValue(name).trim();
    pen.fillRect(0, 0, 1, 1);
    const [r, g, b] = [...pen.getImageData(0, 0, 1, 1).data].map(linear);
    return .2126 * r + .7152 * g + .0722 * b;
  };
  const ratio = (a, b) => (Math.max(light(a), light(b)) + .05) / (Math.min(light(a), light(b)) + .05);
"""
"""Defines the contrast of two colours of the page, by the definition of WCAG 2."""
CONTRAST = f"""(() => {{{RATIO}
  const grounds = ['--paper', '--raised', '--wash'];
  return ['--ink', '--soft', '--alarm'].flatMap((name) => grounds.map((ground) => ratio(name, ground)));
}})()"""
"""Contrast of texts to their grounds."""
BOXES = """[...document.querySelectorAll('.panel:not([hidden])')].map((node) => {
  const r = node.getBoundingClientRect();
  return [r.left, r.top, r.right, r.bottom].map((v) => Math.round(v * 10) / 10);
})"""
"""Boxes of the panels that are shown, pixels."""
CLIPPED = """[...document.querySelectorAll('.numbers')]
  .filter((node) => node.scrollWidth > node.clientWidth + 1).map((node) => node.dataset.table)"""
"""Names of the tables that are wider than their panel."""
PLATE = """(() => {
  const r = document.querySelector('.plate').getBoundingClientRect();
  return [r.x + r.width / 2, r.y + r.height / 2];
})()"""
"""Middle of the plate in the window, pixels."""
RESPONSE = "(({force, shift, tilt}) => [...force, ...shift, tilt])(Explorer.answers.a.state.data.response)"
"""The response that the page shows."""
SETTLED = """Explorer.complete() && Explorer.shownSides().every((side) =>
  Explorer.answers[side].state.data.decoded && Explorer.answers[side].stability.level === 'standard')"""
"""Whether all numbers of the sheet are those of level standard."""
