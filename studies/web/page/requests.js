"use strict";
// Requests to the engine and their answers: the newest wins, late answers are dropped. Every change is
// sent at once, since a newer request replaces one that waits.

const Requests = (engine, { message, show, refuse, progress }) => {
  const MOST_TIMES = 2000;
  const NEW = () => ({ number: 0, flying: 0, since: 0, dirty: false, inputs: [], drawn: {} });
  const sides = { a: NEW(), b: NEW() };
  const times = [];
  const sent = new Map();
  let number = 0;
  let asked = false;
  let open = false;

  // Changes of one event are one request.
  function change(side, input = performance.now()) {
    sides[side].dirty = true;
    if (sides[side].inputs.length < 200) sides[side].inputs.push([Infinity, input]);
    schedule();
  }

  function schedule() {
    if (asked) return;
    asked = true;
    queueMicrotask(() => {
      asked = false;
      send();
    });
  }

  function send() {
    if (!open) return;
    for (const [name, side] of Object.entries(sides)) {
      if (!side.dirty) continue;
      const request = message(name);
      if (!request) {
        side.dirty = false;
        continue;
      }
      number += 1;
      Object.assign(side, { number, flying: number, since: performance.now(), dirty: false });
      for (const input of side.inputs) if (input[0] === Infinity) input[0] = number;
      sent.set(number, side.since);
      if (sent.size > MOST_TIMES) sent.delete(sent.keys().next().value);
      engine.ask({ number, side: name, ...request });
    }
  }

  function receive(answer) {
    const side = sides[answer.side];
    if (!side) return;
    // an error of the server itself belongs to whatever was asked last
    if (answer.error !== undefined && !answer.number) answer.number = side.number;
    if (answer.progress !== undefined) {
      if (answer.number === side.number) progress(answer.side, answer);
      return;
    }
    const part = answer.error === undefined ? answer.part : "state";
    if (answer.number === side.flying && part === "state") {
      side.flying = 0;
      if (side.dirty) schedule();
    }
    const last = side.drawn[part];
    // an answer that is older than the picture, or coarser than it, comes too late
    const coarser = last?.level === "standard" && answer.level === "quick";
    if (last && (answer.number < last.number || (answer.number === last.number && coarser))) return;
    side.drawn[part] = { number: answer.number, level: answer.level };
    if (part === "state") side.answered = { times: answer.times, at: performance.now() };
    if (answer.error !== undefined) {
      side.inputs = side.inputs.filter(([n]) => n > answer.number);
      refuse(answer.side, answer);
    } else show(answer.side, part, answer);
  }

  // Called after a picture is drawn: from each input to the first picture that contains it, ms, and what that time
  // consists of: until the request of the picture was sent, its wait for the worker, the worker's time, transport, and
  // drawing.
  function drawn(name, shown) {
    const side = sides[name];
    const now = performance.now();
    const { times: [queue, work] = [0, 0], at: received = now } = side.answered || {};
    const begin = sent.get(shown) ?? now;
    for (const [n, at] of side.inputs)
      if (n <= shown) {
        times.push({
          total: now - at,
          before: begin - at,
          queue,
          work,
          transport: received - begin - queue - work,
          drawing: now - received,
        });
        if (times.length > MOST_TIMES) times.shift();
      }
    side.inputs = side.inputs.filter(([n]) => n > shown);
  }

  function opened() {
    open = true;
    for (const [name, side] of Object.entries(sides)) {
      side.flying = 0;
      side.inputs = [];
      if (message(name)) side.dirty = true;
    }
    schedule();
  }

  function closed() {
    open = false;
    for (const side of Object.values(sides)) side.flying = 0;
  }
  function forget(name) {
    const drawn = Requests.PARTS.map((part) => [part, { number: number + 0.5 }]);
    sides[name] = { ...NEW(), drawn: Object.fromEntries(drawn) };
  }
  // Whether a part that the newest request asks for is older than this request.
  const behind = (name, part) => sides[name].dirty || (sides[name].drawn[part]?.number || 0) < sides[name].number;
  const resting = () => Object.values(sides).every((side) => !side.dirty && !side.flying);

  engine.onAnswer(receive);
  return {
    change,
    receive,
    drawn,
    opened,
    closed,
    forget,
    behind,
    resting,
    times,
    newest: (name) => sides[name].number,
  };
};
Requests.PARTS = ["state", "curve", "sensor3d", "field_lines", "stability", "vibration", "loop", "commands"];
