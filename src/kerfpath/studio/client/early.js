// Set the theme before the first paint, so that a dark page does not flash.
(function () {
  let theme = null;
  try {
    theme = localStorage.getItem("kerfpath.theme");
  } catch {
    // The browser stores nothing: use the theme of the system.
  }
  const dark = matchMedia("(prefers-color-scheme: dark)").matches;
  document.documentElement.dataset.theme = theme ?? (dark ? "dark" : "light");
})();
