"use strict";
// Requests to the engine and their answers: the newest wins, late answers are dropped. Every change is
// sent at once, since a newer request replaces one that waits.

const Requests = (engine, { message, show, refuse, progress }) => {
  const NEW = () => ({ number: 0, flying: 0, dirty: false, drawn: {} });
  const sides = { a: NEW(), b: NEW() };
  let number = 0;
  let asked = false;
  let open = false;

  function change(side) {
    sides[side].dirty = true;
    schedule();
  }

  // Changes of one event are one request.
  function schedule() {
    if (asked) return;
    asked = true;
    queueMicrotask(() => {
      asked = false;
      if (open) send();
    });
  }

  function send() {
    for (const [name, side] of Object.entries(sides)) {
      const request = side.dirty && message(name);
      side.dirty = false;
      if (!request) continue;
      number += 1;
      Object.assign(side, { number, flying: number });
      engine.ask({ number, side: name, ...request });
    }
  }

  function receive(answer) {
    const side = sides[answer.side];
    if (!side) return;
    const failed = answer.error !== undefined;
    // an error of the server itself belongs to whatever was asked last
    if (failed && !answer.number) answer.number = side.number;
    if (answer.progress !== undefined) {
      if (answer.number === side.number) progress(answer.side, answer);
      return;
    }
    const part = failed ? "state" : answer.part;
    if (answer.number === side.flying && part === "state") side.flying = 0;
    const last = side.drawn[part];
    // an answer that is older than the picture, or coarser than it, comes too late
    const coarser = last?.level === "standard" && answer.level === "quick";
    if (last && (answer.number < last.number || (answer.number === last.number && coarser))) return;
    side.drawn[part] = { number: answer.number, level: answer.level };
    if (failed) refuse(answer.side, answer);
    else show(answer.side, part, answer);
  }

  function opened() {
    open = true;
    Object.keys(sides).forEach(change);
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

  engine.on.answer = receive;
  return { change, receive, opened, closed, forget, behind, resting, newest: (name) => sides[name].number };
};
// those of the page's panels, and one that the section draws
Requests.PARTS = [
  ...new Set(["field_lines", ...Array.from(document.querySelectorAll("[data-part]"), ({ dataset }) => dataset.part)]),
];
