"use strict";
// The theme of a page: that of the system, light or dark; the choice is kept where the browser lets a page keep one.

const Theme = (() => {
  const NAMES = { auto: "Theme: system", light: "Theme: light", dark: "Theme: dark" };
  const KEY = "magtip-theme";

  function put(button, name) {
    if (name === "auto") delete document.documentElement.dataset.theme;
    else document.documentElement.dataset.theme = name;
    button.textContent = NAMES[name];
    button.dataset.now = name;
    Format.recolour();
  }

  // A page opened from a file may have no storage; the choice then lasts as long as the page.
  function kept() {
    try {
      return localStorage.getItem(KEY);
    } catch {
      return null;
    }
  }

  // `changed` is called after the button has changed the theme.
  function start(button, changed = () => {}) {
    put(button, kept() in NAMES ? kept() : "auto");
    button.addEventListener("click", () => {
      const names = Object.keys(NAMES);
      const next = names[(names.indexOf(button.dataset.now) + 1) % names.length];
      put(button, next);
      try {
        localStorage.setItem(KEY, next);
      } catch {
        /* see `kept` */
      }
      changed();
    });
  }

  return { start };
})();
