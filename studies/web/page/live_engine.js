"use strict";
// The engine of a page from the server: questions and answers over the WebSocket /live, which opens again after a loss.

const LiveEngine = () => {
  const FIRST_WAIT = 500;
  const LONGEST_WAIT = 3000;
  const token = new URLSearchParams(location.search).get("token");
  let socket = null;
  // what the page does with answers, rows of a stream, and the loss and the return of the server
  const on = { answer() {}, measured() {}, closed() {}, opened() {} };
  let wait = FIRST_WAIT;

  function connect() {
    const scheme = location.protocol === "https:" ? "wss" : "ws";
    socket = new WebSocket(`${scheme}://${location.host}/live${token ? `?token=${encodeURIComponent(token)}` : ""}`);
    socket.addEventListener("open", () => {
      wait = FIRST_WAIT;
      on.opened();
    });
    socket.addEventListener("message", (event) => {
      const message = JSON.parse(event.data, Format.unpacked);
      if (message.measured) on.measured(message.measured);
      else on.answer(message);
    });
    socket.addEventListener("close", () => {
      socket = null;
      on.closed("gone");
      again();
    });
  }

  // A socket does not say why it fails; a plain request does: no server, or one with another token.
  async function fields() {
    const reply = await fetch(path("page/fields.json"), { cache: "no-store" }).catch(() => null);
    if (!reply?.ok) throw new Error(reply?.status === 403 ? "token" : "gone");
    return reply.json();
  }
  function again() {
    setTimeout(async () => {
      wait = Math.min(wait * 1.5, LONGEST_WAIT);
      try {
        await fields();
        connect();
      } catch (error) {
        on.closed(error.message);
        again();
      }
    }, wait);
  }

  const path = (name) => (token ? `${name}?token=${encodeURIComponent(token)}` : name);
  return {
    // what the page says before the first answer
    wait:
      "Solving the first state. " +
      "The first start after an installation compiles functions, which takes a minute or more.",
    start: connect,
    ask(request) {
      if (socket?.readyState === WebSocket.OPEN) socket.send(JSON.stringify(request));
    },
    on,
    fields,
    // A file of the server for a request; an error carries the server's sentence.
    async file(name, request) {
      const headers = { "Content-Type": "application/json", ...(token ? { "X-Token": token } : {}) };
      const post = { method: "POST", headers, body: JSON.stringify(request) };
      const reply = await fetch(path(`export/${name}`), post).catch(() => null);
      if (!reply) throw new Error("The server does not answer: start it again, then export.");
      if (!reply.ok)
        throw new Error((await reply.text()).slice(0, 400) || `The server refused the export (${reply.status}).`);
      return reply.blob();
    },
  };
};
