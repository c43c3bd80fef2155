"use strict";
// The theme of a page: that of the system, light or dark; the choice is kept where the browser lets a page keep one.

const Theme = (() => {
  const NAMES = { auto: "Theme: system", light: "Theme: light", dark: "Theme: dark" };
  const KEY = "magtip-theme";
  const system = window.matchMedia("(prefers-color-scheme: dark)");

  // A page opened from a file may have no storage; the choice then lasts as long as the page.
  function stored(use) {
    try {
      return use(localStorage);
    } catch {
      return null;
    }
  }

  // `changed` is called after the theme has changed.
  function start(button, changed = () => {}) {
    let now = stored((storage) => storage.getItem(KEY)) || "auto";
    function put() {
      document.documentElement.dataset.theme = now === "auto" ? (system.matches ? "dark" : "light") : now;
      button.textContent = NAMES[now];
    }
    put();
    system.addEventListener("change", () => {
      put();
      changed();
    });
    button.addEventListener("click", () => {
      const names = Object.keys(NAMES);
      now = names[(names.indexOf(now) + 1) % names.length];
      stored((storage) => storage.setItem(KEY, now));
      put();
      changed();
    });
  }

  return { start };
})();
