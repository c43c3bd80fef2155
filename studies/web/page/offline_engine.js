"use strict";
// The engine of a page without a server: it answers with what the server's functions said of the nearest stop, where
// a state was solved when the page was written (studies/web/offline_page.py).

const OfflineEngine = (text) => {
  let page = null;
  const on = { answer() {}, closed() {}, opened() {} };

  // The page's content is JSON as gzip; an array that stands in it several times is named by its place in "arrays".
  async function content() {
    const bytes = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
    const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
    let arrays = [];
    return JSON.parse(await new Response(stream).text(), (key, value) => {
      if (key === "arrays") arrays = value;
      return value?.array === undefined ? Format.unpacked(key, value) : arrays[value.array];
    });
  }

  const nearest = (list, value) =>
    list.reduce((best, one, k) => (Math.abs(one - value) < Math.abs(list[best] - value) ? k : best), 0);

  // The state at the stop of a load: a shear below 0 is one in the other direction.
  function found({ depth, shear, direction }) {
    const { stops } = page;
    const turn = (((shear < 0 ? direction + 180 : direction) % 360) + 360) % 360;
    const stop = page.states[nearest(stops.depth, depth)]?.[nearest(stops.shear, Math.abs(shear))];
    if (!stop || stop.error) throw new Error(stop?.error || "this page has no state of this load");
    const k = stop.directions.length > 1 ? nearest([...stops.direction, 360], turn) % stops.direction.length : 0;
    return { ...stop, ...stop.directions[k], turn: (stops.direction[k] * Math.PI) / 180 };
  }

  // A section is drawn along the direction with x > 0, or along y: a shear to the other side is mirrored.
  function placed({ section, field_lines, turn }) {
    const [c, s] = [Math.cos, Math.sin].map((f) => Number(f(turn).toFixed(12)));
    const way = c < 0 || (c === 0 && s < 0) ? -1 : 1;
    const mirrored = (points) => points.map((v, k) => (k % 2 ? v : way * v));
    const { points, rest, magnet, plate } = section;
    const {
      centre: [x, z],
      tilt,
      lines,
    } = field_lines;
    return {
      section: {
        ...section,
        points: mirrored(points),
        rest: mirrored(rest),
        magnet: magnet.map(([u, v]) => [way * u, v]),
        plate: { ...plate, x: way * plate.x },
        direction: [way * c, way * s],
      },
      field_lines: { lines, centre: [way * x, z], tilt: way * tilt },
    };
  }

  // The whole body from its half and its section, both along x.
  function sensor({ section: { points, fields, triangles }, sensor3d, turn }) {
    const { back, magnet } = sensor3d.parts;
    const front = { ...back, points: back.points.map((v, k) => (k % 3 === 1 ? -v : v)) };
    const place = Array.from(points, (v, k) => (k % 2 ? [0, v] : v)).flat();
    const cut = { points: place, value: fields.displacement, triangles };
    return { ...sensor3d, parts: { back, front, cut, ...(magnet ? { magnet } : {}) }, turn };
  }

  function parts({ state, parts: wanted }) {
    const stop = found(state.load);
    const { section, field_lines } = placed(stop);
    const every = {
      state: { ...stop.state, section },
      curve: page.curve,
      sensor3d: sensor(stop),
      commands: stop.commands,
      field_lines,
      ...page.panels,
    };
    return wanted.filter((name) => every[name]).map((name) => [name, every[name]]);
  }

  // The answers come after the present frame; whatever fails reaches the page as a sentence.
  function ask(request) {
    const { number, side } = request;
    setTimeout(() => {
      try {
        for (const [part, data] of parts(request)) on.answer({ number, side, part, level: "standard", data });
      } catch (error) {
        on.answer({ number, side, error: error.message, field: null });
      }
    }, 0);
  }

  return {
    time: "solved beforehand",
    start: () => setTimeout(() => on.opened(), 0),
    ask,
    async fields() {
      page = await content();
      return page;
    },
    // files that need no server
    async file(name, { state }) {
      const file = page.files[name] ?? found(state.load)[name];
      if (file === undefined) throw new Error(`This page has no server, which ${name} needs: run magtip explore.`);
      return new Blob([file], { type: "text/plain" });
    },
    on,
  };
};
