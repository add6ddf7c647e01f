// The linked views of a Pareto set: scatter plot, parallel axes, table, and the picked plan.
const FRONT = JSON.parse(document.getElementById("front").textContent);
const SCATTER = document.querySelector(".front-scatter");
const PARALLEL = document.querySelector(".front-parallel"); // null with a single criterion
const KEPT = document.querySelector(".kept");
const PANEL = document.querySelector(".picked");
const BODY = document.querySelector(".plans tbody");
const ROWS = FRONT.plans.map(({ number }) => BODY.querySelector(`[data-plan="${number}"]`));
const VALUES = FRONT.plans.map(({ values }) => values);
const PLANS = 1; // the trace of the scatter plot between those of beaten plans and of the picked one

let picked = -1; // a place among the plans; -1: none
let inside = VALUES.map(() => true); // which plans are within all brushes

const column = (i) => VALUES.map((values) => values[i]);
const choice = (key) => Number(document.querySelector(`[data-choice="${key}"]`).value); // -1: none
// The best colour of a scale, which is the first, stands out most from the page.
const scale = () => FRONT.look.scale[DARK.matches ? "dark" : "light"];
const isDrawn = (plot) => plot?.dataset.state === "drawn";

// ---- Scatter plot

function showScatter() {
  if (!isDrawn(SCATTER)) return;
  const [x, y, colour] = ["x", "y", "colour"].map(choice);
  const shown = [FRONT.dominated, VALUES, picked < 0 ? [] : [VALUES[picked]]];
  const data = SCATTER.data.map((trace, k) => ({
    ...trace,
    x: shown[k].map((values) => values[x]),
    y: shown[k].map((values) => (y < 0 ? 0 : values[y])),
  }));
  const stops = scale().map((shade, k, { length }) => [k / (length - 1), shade]);
  const marker = { ...data[PLANS].marker, color: colourOf("--accent"), colorscale: stops, showscale: false };
  if (colour >= 0) {
    const { title, sense } = FRONT.axes[colour];
    Object.assign(marker, { color: column(colour), reversescale: sense < 0, showscale: true });
    const text = `${title}, better ${sense > 0 ? "↓" : "↑"}`;
    marker.colorbar = { ...marker.colorbar, title: { ...marker.colorbar.title, text } };
  }
  const kept = inside.every(Boolean) ? null : VALUES.flatMap((_, i) => (inside[i] || i === picked ? [i] : []));
  Object.assign(data[PLANS], { marker, selectedpoints: kept, text: FRONT.plans.map(inWords) });
  const layout = { ...SCATTER.layout, annotations: [], xaxis: axisOf(x, SCATTER.layout.xaxis, "←", "→") };
  if (y >= 0) layout.yaxis = axisOf(y, SCATTER.layout.yaxis, "↓", "↑");
  // Labels are placed once the points are drawn.
  Plotly.react(SCATTER, data, layout).then(() => Plotly.relayout(SCATTER, { annotations: labels(data[PLANS]) }));
}

// The plans fill the plot; dominated ones extend an axis by at most half of the span on either side.
function axisOf(i, axis, less, more) {
  const { title, sense } = FRONT.axes[i];
  const [plans, beaten] = [column(i), FRONT.dominated.map((values) => values[i])];
  const [low, high] = [Math.min(...plans), Math.max(...plans)];
  const span = high - low || Math.abs(high) || 1;
  const from = Math.max(Math.min(low, ...beaten), low - span / 2);
  const to = Math.min(Math.max(high, ...beaten), high + span / 2);
  const rim = 0.07 * (to - from || span);
  const text = `${title}, better ${sense > 0 ? less : more}`;
  return { ...axis, title: { ...axis.title, text }, autorange: false, range: [from - rim, to + rim] };
}

function inWords({ number, marks }, i) {
  const lines = FRONT.axes.map(({ title }, k) => `${title}: ${ROWS[i].cells[k + 1].textContent}`);
  return [`<b>Plan ${number}</b>`, ...marks, ...lines].join("<br>");
}

// Labels of marked plans; each is placed around its point where it covers least.
function labels({ x, y }) {
  const { xaxis, yaxis } = SCATTER._fullLayout;
  const points = x.map((_, i) => [xaxis.d2p(x[i]), yaxis.d2p(y[i])]);
  const boxes = [];
  return FRONT.plans.flatMap(({ marks }, i) => {
    if (!marks.length) return [];
    const [w, h] = [6.4 * Math.max(...marks.map((mark) => mark.length)) + 8, 15.6 * marks.length + 6]; // px
    const boxAt = ([dx, dy]) => [points[i][0] + dx - w / 2, points[i][1] + dy - h / 2];
    const cost = (place) => {
      const [left, top] = boxAt(place);
      const outside = left < 0 || top < 0 || left + w > xaxis._length || top + h > yaxis._length;
      const overlaps = boxes.filter(([l, t, r, b]) => left < r && l < left + w && top < b && t < top + h);
      const covered = points.filter(([px, py]) => Math.abs(px - left - w / 2) < w / 2 + 6 && Math.abs(py - top - h / 2) < h / 2 + 6);
      return 1e5 * outside + 1e4 * overlaps.length + 20 * covered.length + Math.hypot(...place);
    };
    const best = PLACES.map(([right, down, r]) => [right * (r + w / 2), down * (r + h / 2)]).reduce((a, b) => (cost(b) < cost(a) ? b : a));
    const [left, top] = boxAt(best);
    boxes.push([left, top, left + w, top + h]);
    const colours = { arrowcolor: colourOf("--quiet"), bgcolor: colourOf("--label"), font: { size: 12, color: colourOf("--ink") } };
    return [{ ...FRONT.look.label, ...colours, x: x[i], y: y[i], ax: best[0], ay: best[1], text: marks.join("<br>") }];
  });
}

const PLACES = [18, 40, 75, 120].flatMap((r) =>
  [[1, 0], [-1, 0], [0, -1], [0, 1], [0.8, -0.8], [-0.8, -0.8], [0.8, 0.8], [-0.8, 0.8]].map((way) => [...way, r]),
);

// ---- Parallel axes

// All lines have one width: the picked one is several lines side by side, in a colour above the scale.
function showParallel() {
  if (!isDrawn(PARALLEL)) return;
  const beside = picked < 0 ? [] : [-2, -1, 0, 1, 2];
  const change = {};
  PARALLEL.data[0].dimensions.forEach(({ range }, i) => {
    const step = (range[1] - range[0]) / 400;
    change[`dimensions[${i}].values`] = [[...column(i), ...beside.map((k) => VALUES[picked][i] + k * step)]];
  });
  const colour = choice("colour");
  const [accent, chosen] = ["--accent", "--chosen"].map(colourOf);
  const shades = colour < 0 ? [accent, accent] : scale();
  const stops = shades.map((shade, k) => [(0.98 * k) / (shades.length - 1), shade]);
  change["line.colorscale"] = [[...stops, [0.99, chosen], [1, chosen]]];
  change["line.color"] = [[...VALUES.map((values) => (colour < 0 ? 0 : 0.98 * share(values, colour))), ...beside.map(() => 1)]];
  Plotly.restyle(PARALLEL, change);
}

// The share of a plan in a criterion, from 0 (best plan) to 1 (worst plan).
function share(values, i) {
  const losses = column(i).map((value) => value * FRONT.axes[i].sense);
  const [low, high] = [Math.min(...losses), Math.max(...losses)];
  return high > low ? (values[i] * FRONT.axes[i].sense - low) / (high - low) : 0;
}

// A brush is [from, to], several on one axis a list of them.
function brushed() {
  const brushes = PARALLEL.data[0].dimensions.map(({ constraintrange: brush }) => (brush?.length ? [brush].flat(2) : []));
  const isIn = (value, ends) => !ends.length || ends.some((_, k) => k % 2 === 0 && value >= ends[k] && value <= ends[k + 1]);
  const now = VALUES.map((values) => values.every((value, i) => isIn(value, brushes[i])));
  if (now.every((is, i) => is === inside[i])) return;
  inside = now;
  ROWS.forEach((row, i) => row.classList.toggle("out", !inside[i]));
  const count = inside.filter(Boolean).length;
  KEPT.firstElementChild.textContent = count < VALUES.length ? `${count} of ${VALUES.length} plans in all ranges` : "";
  KEPT.lastElementChild.hidden = count === VALUES.length;
  showScatter();
}

function unbrush() {
  const none = PARALLEL.data[0].dimensions.map((_, i) => [`dimensions[${i}].constraintrange`, [null]]);
  Plotly.restyle(PARALLEL, Object.fromEntries(none));
}

// ---- The picked plan

function pick(i) {
  picked = i;
  const { number, values, asked } = FRONT.plans[i];
  ROWS.forEach((row, k) => (k === i ? row.setAttribute("aria-current", "true") : row.removeAttribute("aria-current")));
  PANEL.querySelectorAll(".marks button").forEach((button) => button.setAttribute("aria-pressed", Number(button.dataset.plan) === number));
  PANEL.querySelector(".hint").hidden = true;
  PANEL.querySelector(".plan").hidden = false;
  PANEL.querySelector("h2").textContent = `Plan ${number}`;
  PANEL.querySelectorAll(".values .n").forEach((cell, k) => (cell.textContent = `${ROWS[i].cells[k + 1].textContent} ${FRONT.axes[k].unit}`));
  PANEL.querySelectorAll(".place i i").forEach((dot, k) => (dot.style.left = `${100 * share(values, k)}%`));
  PANEL.querySelector(".asked").hidden = !asked.length;
  PANEL.querySelector(".asked dl").replaceChildren(...asked.flatMap(([what, value]) => [element("dt", what), element("dd", value)]));
  PANEL.querySelector("pre").textContent = FRONT.command.replaceAll("{number}", number);
  PANEL.querySelector(".copy").textContent = COPY;
  showScatter();
  showParallel();
}

const COPY = "Copy the command";

function element(name, text) {
  const made = document.createElement(name);
  made.textContent = text;
  return made;
}

async function copy(button) {
  const command = PANEL.querySelector("pre");
  try {
    await navigator.clipboard.writeText(command.textContent);
    button.textContent = "Copied";
  } catch {
    // Some browsers do not let a page from a file copy: the reader does.
    getSelection().selectAllChildren(command);
    button.textContent = "Selected: copy it with Ctrl+C";
  }
}

// ---- Table

function sort(button) {
  const head = button.closest("th"), i = Number(button.dataset.sort);
  // Sort the better end first; the next click reverses the order.
  const sense = i < 0 ? 1 : FRONT.axes[i].sense;
  const first = sense > 0 ? "ascending" : "descending";
  const other = sense > 0 ? "descending" : "ascending";
  const order = head.getAttribute("aria-sort") === first ? other : first;
  head.parentElement.querySelectorAll("th").forEach((th) => th.removeAttribute("aria-sort"));
  head.setAttribute("aria-sort", order);
  const key = (k) => (i < 0 ? FRONT.plans[k].number : VALUES[k][i]) * (order === "ascending" ? 1 : -1);
  BODY.append(...VALUES.map((_, k) => k).sort((a, b) => key(a) - key(b)).map((k) => ROWS[k]));
}

// Only one row is in the tab order; arrow keys move to the others.
BODY.addEventListener("focusin", ({ target }) => ROWS.forEach((row) => (row.tabIndex = row === target ? 0 : -1)));
BODY.addEventListener("click", ({ target }) => pick(ROWS.indexOf(target.closest("tr"))));
BODY.addEventListener("keydown", (event) => {
  const { target: row, key } = event;
  if (key === "Enter" || key === " ") pick(ROWS.indexOf(row));
  else if (key === "ArrowDown") row.nextElementSibling?.focus();
  else if (key === "ArrowUp") row.previousElementSibling?.focus();
  else return;
  event.preventDefault();
});
document.querySelector(".plans thead").addEventListener("click", ({ target }) => target.dataset.sort && sort(target));
PANEL.addEventListener("click", ({ target }) => {
  const button = target.closest("button");
  if (button?.dataset.plan) pick(FRONT.plans.findIndex(({ number }) => number === Number(button.dataset.plan)));
  else if (button) copy(button);
});
document.querySelectorAll("[data-choice]").forEach((box) =>
  box.addEventListener("change", () => {
    showScatter();
    if (box.dataset.choice === "colour") showParallel();
  }),
);
SCATTER.addEventListener("themed", showScatter);
PARALLEL?.addEventListener("themed", showParallel);
KEPT?.lastElementChild.addEventListener("click", unbrush);
SCATTER.addEventListener("drawn", () => {
  SCATTER.on("plotly_click", ({ points: [point] }) => point.curveNumber === PLANS && pick(point.pointNumber));
  showScatter();
});
PARALLEL?.addEventListener("drawn", () => {
  PARALLEL.on("plotly_restyle", brushed);
  showParallel();
});
if (FRONT.plans.length === 1) pick(0);
