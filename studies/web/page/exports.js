"use strict";
// Files to the user, and the picture of the page's canvases and figures.

const Exports = (() => {
  const GAP = 24;
  const LINE = 22;

  function save(name, blob) {
    const link = Format.make("a", { href: URL.createObjectURL(blob), download: name }, document.body);
    link.click();
    link.remove();
    setTimeout(() => URL.revokeObjectURL(link.href), 1000);
  }

  // A figure as an image of the screen's pixels, in the colours of the present theme.
  async function drawn(svg, ratio) {
    const { width, height } = svg.getBoundingClientRect();
    const text = svg.outerHTML.replace(/var\((--\w+)\)/g, (_, name) => Format.colour(name));
    const image = new Image(width * ratio, height * ratio);
    image.src = `data:image/svg+xml,${encodeURIComponent(text)}`;
    await image.decode();
    return image;
  }

  // Rows of canvases and figures under each other, on paper of their own, with lines of text above.
  async function picture(texts, rows) {
    const ratio = Format.pixels();
    const gap = GAP * ratio;
    const line = LINE * ratio;
    const seen = rows.map((row) => row.filter((one) => one?.getClientRects().length)).filter((row) => row.length);
    const shown = await Promise.all(
      seen.map((row) => Promise.all(row.map((one) => (one.getContext ? one : drawn(one, ratio))))),
    );
    const width = Math.max(...shown.map((row) => row.reduce((sum, one) => sum + one.width + gap, gap)), 400 * ratio);
    const height = shown.reduce(
      (sum, row) => sum + Math.max(...row.map((one) => one.height)) + gap,
      gap + texts.length * line + gap,
    );
    const sheet = document.createElement("canvas");
    const pen = sheet.getContext("2d");
    sheet.width = width;
    sheet.height = height;
    pen.fillStyle = Format.colour("--paper");
    pen.fillRect(0, 0, width, height);
    pen.fillStyle = Format.colour("--ink");
    pen.textBaseline = "top";
    texts.forEach((text, k) => {
      pen.font = `${k ? "" : "600 "}${(k ? 13 : 16) * ratio}px system-ui, sans-serif`;
      pen.fillText(text, gap, gap + k * line, width - 2 * gap);
    });
    let y = 2 * gap + texts.length * line;
    for (const row of shown) {
      let x = gap;
      for (const one of row) {
        pen.drawImage(one, x, y, one.width, one.height);
        x += one.width + gap;
      }
      y += Math.max(...row.map((one) => one.height)) + gap;
    }
    return new Promise((done) => sheet.toBlob(done, "image/png"));
  }

  return { save, picture };
})();
