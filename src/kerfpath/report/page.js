"use strict";
// Figures are stored deflated; each is unpacked and drawn when its section is first opened.
const CONFIG = {
  responsive: true,
  displaylogo: false,
  modeBarButtonsToRemove: ["lasso2d", "select2d"],
  // plotly's "Share chart" button would send the customer's data to plotly's servers.
  showSendToCloud: false,
  plotlyServerURL: "",
};
const PAPER = { width: 700, height: 820 }; // px, on A4 and Letter, below a heading

async function unpacked(id) {
  const bytes = Uint8Array.from(atob(document.getElementById(id).textContent), (c) => c.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  return JSON.parse(await new Response(stream).text());
}

// Figures with a scale of colours are drawn in the colours of the page, which is light on paper.
const DARK = matchMedia("screen and (prefers-color-scheme: dark)");
const PAGE_COLOURS = { "#1d2530": "--ink", "#5b6675": "--quiet", "#98a1ad": "--rule", "#e6e9ee": "--line", "#d3d8df": "--rule", white: "--page" };
const scaled = new Map(); // each by its element, as packed

const colourOf = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

function inTheme(figure) {
  if (!DARK.matches) return figure;
  const text = JSON.stringify(figure);
  return JSON.parse(text, (_, value) => (Object.hasOwn(PAGE_COLOURS, value) ? colourOf(PAGE_COLOURS[value]) : value));
}

DARK.addEventListener("change", () => {
  for (const [element, figure] of scaled) {
    const { data, layout } = inTheme(figure);
    Plotly.react(element, data, layout);
    element.dispatchEvent(new Event("themed"));
  }
});

const underway = new Map();

// Draws a figure once; a second call waits for the first.
function draw(element) {
  if (!underway.has(element)) underway.set(element, drawn(element));
  return underway.get(element);
}

async function drawn(element) {
  element.dataset.state = "drawing";
  try {
    const packed = await unpacked(element.dataset.figure);
    const isScaled = element.classList.contains("scaled");
    if (isScaled) scaled.set(element, packed);
    const figure = isScaled ? inTheme(packed) : packed;
    await Plotly.newPlot(element, figure.data, figure.layout, CONFIG);
    if (element.classList.contains("map")) explain(element);
    element.dataset.state = "drawn";
    element.dispatchEvent(new Event("drawn", { bubbles: true }));
  } catch (error) {
    element.dataset.state = "failed";
    const note = document.createElement("p");
    note.className = "trouble";
    const old = typeof DecompressionStream === "undefined";
    note.textContent = `This figure could not be drawn: ${old ? "it needs a browser from 2023 or newer" : error}.`;
    element.replaceChildren(note);
  }
}

// The text for the pixel under the pointer; a text per pixel would make the file many times larger.
function explain(element) {
  const { reasons, s_mm } = element.layout.meta;
  element.on("plotly_hover", ({ points: [point], event }) => {
    if (point.data.type !== "heatmap") return;
    const node = Math.round(point.x);
    const s = s_mm.length ? `, ${s_mm[node].toFixed(1)} mm` : "";
    const tip = document.getElementById("tip") || document.body.appendChild(document.createElement("div"));
    tip.id = "tip";
    tip.innerHTML = "<b></b><span></span>";
    tip.firstChild.textContent = reasons[point.z];
    tip.lastChild.textContent = `node ${node}${s}, gamma ${point.y.toFixed(1)}°, ${point.data.meta.posture}`;
    const left = Math.min(event.clientX + 14, window.innerWidth - tip.offsetWidth - 8);
    tip.style.left = `${left}px`;
    tip.style.top = `${event.clientY + 16}px`;
  });
  element.on("plotly_unhover", () => document.getElementById("tip")?.remove());
}

function drawIn(root) {
  root.querySelectorAll("[data-figure]").forEach((element) => {
    const section = element.closest("details");
    if (!section || section.open) draw(element);
  });
}

function openTarget() {
  const target = location.hash && document.getElementById(location.hash.slice(1));
  if (target && target.tagName === "DETAILS") target.open = true;
}

document.querySelectorAll("details").forEach((section) => {
  section.addEventListener("toggle", () => section.open && drawIn(section));
});
window.addEventListener("hashchange", openTarget);
// Open sections are printed, at the width of the paper and no higher than a page. A 3-D scene is not
// drawn again before the page is printed: its picture on the screen is scaled down.
window.addEventListener("beforeprint", () => {
  for (const plot of document.querySelectorAll(".js-plotly-plot")) {
    if (plot.classList.contains("scene")) {
      plot.style.width = `${plot.clientWidth}px`;
      plot.style.zoom = Math.min(1, PAPER.width / plot.clientWidth);
      continue;
    }
    plot.dataset.height ??= plot.layout.height;
    Plotly.relayout(plot, { width: PAPER.width, height: Math.min(plot.dataset.height, PAPER.height) });
  }
});
window.addEventListener("afterprint", () => {
  for (const plot of document.querySelectorAll(".js-plotly-plot")) {
    if (plot.classList.contains("scene")) {
      plot.style.width = plot.style.zoom = "";
      continue;
    }
    Plotly.relayout(plot, { width: null, height: Number(plot.dataset.height), autosize: true });
  }
});
openTarget();
drawIn(document);
