// The figures of a contour share one cursor: the node under the pointer in one figure is marked in
// all of them, and on the part.
const SCENE = document.querySelector(".figure.scene");

// The contour number of a point of a figure, and its share of the way through the nodes.
function pointed(plot, point) {
  if (plot === SCENE) {
    const contour = point.data.meta?.contour;
    const last = point.fullData.x.length - 1;
    return contour === undefined || !last ? null : { contour, share: point.pointNumber / last };
  }
  const nodes = plot.layout.meta.nodes;
  let nearest = 0;
  nodes.forEach((x, k) => {
    if (Math.abs(x - point.x) < Math.abs(nodes[nearest] - point.x)) nearest = k;
  });
  const contour = Number(plot.closest("details").id.split("-").pop());
  return { contour, share: nearest / (nodes.length - 1) };
}

function mark(plot, share) {
  plot.querySelectorAll(".cursor").forEach((line) => line.remove());
  if (share === null) return;
  const nodes = plot.layout.meta.nodes;
  const x = nodes[Math.round(share * (nodes.length - 1))];
  for (const { xaxis, yaxis } of Object.values(plot._fullLayout._plots)) {
    const along = xaxis.d2p(x);
    if (along < 0 || along > xaxis._length) continue;
    const line = document.createElement("div");
    line.className = "cursor";
    line.style.left = `${xaxis._offset + along}px`;
    line.style.top = `${yaxis._offset}px`;
    line.style.height = `${yaxis._length}px`;
    plot.append(line);
  }
}

function markOnPart(place) {
  if (SCENE?.dataset.state !== "drawn") return;
  const at = { x: [null], y: [null], z: [null] };
  if (place) {
    const { x, y, z } = SCENE._fullData.find((trace) => trace.meta?.contour === place.contour);
    const k = Math.round(place.share * (x.length - 1));
    Object.assign(at, { x: [x[k]], y: [y[k]], z: [z[k]] });
  }
  const cursor = SCENE.data.findIndex((trace) => trace.name === "cursor");
  Plotly.restyle(SCENE, { x: [at.x], y: [at.y], z: [at.z] }, [cursor]);
}

let wanted; // the place to mark next: the pointer moves faster than figures are drawn

function show(place, source) {
  const isIdle = wanted === undefined;
  wanted = { place, source };
  if (!isIdle) return;
  requestAnimationFrame(() => {
    const { place: now, source: from } = wanted;
    wanted = undefined;
    for (const plot of document.querySelectorAll('details[open] [data-state="drawn"]')) {
      const isOfContour = now && plot.closest(`#contour-${now.contour}`);
      if (plot.layout.meta?.nodes) mark(plot, isOfContour ? now.share : null);
    }
    if (from !== SCENE) markOnPart(now);
  });
}

document.addEventListener("drawn", ({ target: plot }) => {
  if (plot !== SCENE && !plot.layout.meta?.nodes) return;
  plot.on("plotly_hover", ({ points: [point] }) => show(pointed(plot, point), plot));
  plot.on("plotly_unhover", () => show(null, plot));
});

// Every contour is opened and drawn before the page is printed, and closed again afterwards.
document.querySelector(".whole")?.addEventListener("click", async ({ target: button }) => {
  const said = button.textContent;
  const closed = [...document.querySelectorAll("details:not([open])")];
  const figures = [...document.querySelectorAll("[data-figure]")];
  for (const section of closed) section.open = true;
  for (const [k, figure] of figures.entries()) {
    button.textContent = `Drawing ${k + 1} of ${figures.length}`;
    await draw(figure);
  }
  button.textContent = said;
  window.print();
  for (const section of closed) section.open = false;
});
