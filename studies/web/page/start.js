"use strict";
// Start of the page: fields, views and engine; the connection; copies, exports and the theme.

(async () => {
  const { $, engine, sides, answers, view } = Explorer;
  const GONE =
    "The server does not answer; the last pictures stay. " +
    "If it was stopped, start it again with the same port: this page connects by itself and goes on from here.";
  const OTHER =
    "A server answers here, but with another token: open the address that it printed. " +
    "The state of this page is the part of its address after the sign #.";

  engine.on.closed = (why) => {
    document.body.dataset.server = why;
    Explorer.requests()?.closed();
    Explorer.say(why === "token" ? OTHER : GONE);
  };
  let fields = null;
  let charts = null;
  try {
    ({ fields, charts } = await engine.fields());
  } catch (error) {
    Explorer.say(
      error.message === "token"
        ? OTHER
        : "The server does not answer: start magtip explore and open the address that it prints.",
    );
    return;
  }

  const views = { sections: {}, sensors: {} };
  for (const side of ["a", "b"]) {
    views.sections[side] = SectionView.start($(`figure.section[data-side=${side}]`), {
      load: () => sides[side],
      value: (name) => sides[side][name],
      move(depth, shear, done) {
        Explorer.set(side, "shear", shear, false);
        Explorer.set(side, "depth", depth, done);
        if (done) Explorer.commitSoon();
      },
    });
    views.sensors[side] = SensorView.start($(`figure.sensor[data-side=${side}]`), Explorer.turn, () =>
      Explorer.touch("turn"),
    );
  }
  const named = (kind, make) =>
    Object.fromEntries(
      [...document.querySelectorAll(`[data-${kind}]`)].map((box) => [box.dataset[kind], { box, ...make(box) }]),
    );
  // Drawings of a design as images, by their names.
  const WORDS = { lengths: "Lengths of the sensor", loads: "Loads of the sensor, with their signs" };
  const drawings = (figure) => {
    let shown = null;
    return (picture) => {
      if (picture === shown) return;
      shown = picture;
      figure.replaceChildren();
      for (const [name, text] of Object.entries(picture ?? {}))
        Format.make("img", { src: `data:image/svg+xml,${encodeURIComponent(text)}`, alt: WORDS[name] }, figure);
    };
  };
  const painters = { array: ArrayView.start, drawing: drawings };
  const painted = (name) => ["a", "b"].map((side) => [side, $(`figure.${name}[data-side=${side}]`)]);
  views.pictures = Object.fromEntries(
    Object.keys(painters)
      .filter((name) => $(`figure.${name}`))
      .map((name) => [
        name,
        Object.fromEntries(painted(name).map(([side, figure]) => [side, painters[name](figure, side)])),
      ]),
  );
  views.charts = charts;
  views.tables = named("table", (box) => ({ show: Numbers.table(box) }));
  views.figures = named("chart", (box) => Figures.changing(box, charts.theme));
  const controls = Controls.build(fields, $("#groups"), (field, value, done) => {
    if (field.name === "beam") {
      Explorer.choose(view.edit, value);
      return;
    }
    const values = field.sets ? (field.sets[value] ?? {}) : { [field.name]: value };
    for (const [name, one] of Object.entries(values)) Explorer.set(view.edit, name, one, done);
  });
  const requests = Requests(engine, Explorer);
  Explorer.use({ fields, controls, views, requests });
  Explorer.wire();

  Theme.start($("#theme"), () => Explorer.touch("state", "curve"));

  const tell = (text) => {
    $("#live").textContent = text;
    Format.put($("#done"), text);
    clearTimeout(tell.timer);
    tell.timer = setTimeout(() => Format.put($("#done"), ""), 4000);
  };
  const close = (button) => {
    const menu = button.closest("details");
    menu.open = false;
    $("summary", menu).focus();
  };
  for (const menu of document.querySelectorAll("details.menu")) {
    menu.addEventListener("keydown", (event) => {
      if (event.key === "Escape") {
        menu.open = false;
        $("summary", menu).focus();
      }
    });
    document.addEventListener("pointerdown", (event) => {
      if (!menu.contains(event.target)) menu.open = false;
    });
  }
  for (const button of document.querySelectorAll("[data-copy]"))
    button.addEventListener("click", async () => {
      Explorer.commit();
      const address = location.href.replace(/([?&])token=[^&#]*/, "$1").replace(/[?&](?=#|$)/, "");
      const text =
        button.dataset.copy === "address" ? address : answers[view.edit].commands?.data[button.dataset.copy];
      close(button);
      // the clipboard needs the user's consent
      const copied = navigator.clipboard?.writeText(text ?? "") ?? Promise.reject();
      tell(await copied.then(() => "Copied.").catch(() => "Not copied: the text stands at the end of the page."));
    });
  for (const button of document.querySelectorAll("[data-export]"))
    button.addEventListener("click", async () => {
      const name = button.dataset.export;
      close(button);
      tell("Exporting …");
      try {
        const request = { number: 0, side: view.edit, ...Explorer.message(view.edit) };
        Exports.save(`magtip-${name}`, name === "picture.png" ? await picture() : await engine.file(name, request));
        tell(`Exported ${name}.`);
      } catch (error) {
        tell("");
        Explorer.say(error.message);
      }
    });

  function picture() {
    const list = Explorer.shownSides();
    const texts = [
      "magtip explore",
      $("#sensor-name").textContent,
      ...list.map((side) => $(`figure.section[data-side=${side}] figcaption`).textContent),
    ];
    const rows = ["sections", "sensors"].map((kind) => list.map((side) => views[kind][side].canvas));
    return Exports.picture(texts, [...rows, Object.values(views.figures).map(({ box }) => box.querySelector("svg"))]);
  }

  engine.on.opened = () => {
    delete document.body.dataset.server;
    if (/server/i.test(Explorer.notice())) Explorer.say("");
    requests.opened();
  };
  engine.on.measured = Measured($("#measured-panel"), charts, () => engine.ask({ zero: true }));
  Explorer.begin();
  engine.start();
  document.documentElement.dataset.ready = "yes";
})();
