// The theme, set before the first picture so that a dark page never flashes.
(function () {
  let theme = null;
  try {
    theme = localStorage.getItem("kerfpath.theme");
  } catch {
    // A browser that keeps nothing: as the system says.
  }
  const dark = matchMedia("(prefers-color-scheme: dark)").matches;
  document.documentElement.dataset.theme = theme ?? (dark ? "dark" : "light");
})();
