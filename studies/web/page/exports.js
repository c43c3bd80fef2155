"use strict";
// Files to the user, and the picture of the page's canvases.

const Exports = (() => {
  const GAP = 24;
  const LINE = 22;

  function save(name, blob) {
    const link = Format.make("a", { href: URL.createObjectURL(blob), download: name }, document.body);
    link.click();
    link.remove();
    setTimeout(() => URL.revokeObjectURL(link.href), 1000);
  }

  // Rows of canvases under each other, on paper of their own, with lines of text above.
  function picture(texts, rows) {
    const ratio = Format.pixels();
    const gap = GAP * ratio;
    const line = LINE * ratio;
    const shown = rows
      .map((row) => row.filter((canvas) => canvas && canvas.width && canvas.offsetParent !== null))
      .filter((row) => row.length);
    const width = Math.max(
      ...shown.map((row) => row.reduce((sum, canvas) => sum + canvas.width + gap, gap)),
      400 * ratio,
    );
    const height = shown.reduce(
      (sum, row) => sum + Math.max(...row.map((canvas) => canvas.height)) + gap,
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
      for (const canvas of row) {
        pen.drawImage(canvas, x, y);
        x += canvas.width + gap;
      }
      y += Math.max(...row.map((canvas) => canvas.height)) + gap;
    }
    return new Promise((done) => sheet.toBlob(done, "image/png"));
  }

  return { save, picture };
})();
