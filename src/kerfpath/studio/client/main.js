/** Assemble the page: its views follow the state, its panels are drawn from it. */

import { connection, player, send, store } from "./app.js";
import { followTheme, splitter } from "./desk.js";
import { byId } from "./dom.js";
import { MapView } from "./map/view.js";
import { foot, notices, topBar } from "./panels/bar.js";
import { cellSheet, followDrops } from "./panels/cell.js";
import { comparePanel, followKept } from "./panels/compare.js";
import { contoursPanel } from "./panels/contours.js";
import { formPanel } from "./panels/form.js";
import { frontPanel } from "./panels/front.js";
import { jobSheet } from "./panels/jobtext.js";
import { jointsPanel } from "./panels/joints.js";
import { layoutSheet } from "./panels/layout.js";
import { loopsSheet } from "./panels/loops.js";
import { followFastest, optionsPanel } from "./panels/options.js";
import { followProgram, programSheet } from "./panels/program.js";
import { auditPanel, resultPanel } from "./panels/result.js";
import { drawSheet, prepareSheets } from "./panels/sheet.js";
import { Track } from "./panels/track.js";
import { Plots } from "./plots.js";
import { recordings } from "./scene/record.js";
import { SceneView } from "./scene/view.js";
import { timelineOf } from "./timeline.js";
import { mount, redraw } from "./ui.js";

// Build the timeline before the views are called, which depend on it.
let loading = false;
store.on(["plan", "program", "scene"], () => {
  if (loading) return;
  loading = true;
  queueMicrotask(() => {
    loading = false;
    const joints = store.scene?.robot.joints.length ?? 0;
    player.load(timelineOf(store.program, store.plans, store.contours(), joints));
  });
});

const view = new SceneView();
const map = new MapView((q, admitted) => view.haunt(q, admitted));
const plots = new Plots();
const extras = recordings(view);
new Track();
followKept(view);
followFastest();
followProgram();
followDrops();
prepareSheets({
  cell: cellSheet,
  text: jobSheet,
  program: programSheet,
  loops: loopsSheet,
  layout: layoutSheet(view.placing),
});
mount(byId("top"), () => topBar(extras));
mount(byId("notices"), notices);
mount(byId("left"), contoursPanel);
mount(byId("result"), () => resultPanel(view));
mount(byId("compare"), () => comparePanel(view));
mount(byId("front"), frontPanel);
mount(byId("joints"), jointsPanel);
mount(byId("options"), optionsPanel);
mount(byId("more"), formPanel);
mount(byId("audit"), auditPanel);
mount(byId("status"), foot);
mount(byId("sheet"), drawSheet);
store.on(["anything"], redraw);
// What a gesture changes is drawn with the next frame; its handlers need not ask for it.
for (const type of ["click", "input", "change"]) document.addEventListener(type, redraw);
splitter();
followTheme(() => {
  view.paint();
  map.paint();
  plots.invalidate();
  redraw();
});

// Playing selects the contour that is being cut; selecting a contour moves the player there.
let followed = "";
player.on((moment) => {
  const contour = moment?.span.contour ?? null;
  if (!contour || contour === followed) return;
  followed = contour;
  if (player.playing || document.activeElement?.id === "scrub") store.select(contour);
});
store.on(["selected"], () => {
  const { selected } = store;
  if (!selected) return;
  send({ type: "focus", contour: selected });
  if (player.playing || player.moment?.span.contour === selected) return;
  const begin = player.timeline.begin(selected);
  if (begin !== null && document.activeElement?.id !== "scrub") player.seek(begin);
});

// A clicked button loses the focus again, so that the space bar plays.
document.addEventListener("click", (event) => {
  const button = /** @type {HTMLElement} */ (event.target).closest("button");
  const clicked = event.detail > 0 && button === document.activeElement;
  if (button && clicked && !button.closest("dialog")) button.blur();
});

document.addEventListener("keydown", (event) => {
  const target = /** @type {HTMLElement} */ (event.target);
  const typing =
    target.closest("textarea, select, dialog:not(.docked), input:not([type=range])") !== null;
  const [command, { key }] = [event.ctrlKey || event.metaKey, event];
  if (command && key.toLowerCase() === "z" && !typing) {
    send({ type: event.shiftKey ? "redo" : "undo" });
    event.preventDefault();
  } else if (command && key.toLowerCase() === "y" && !typing) {
    send({ type: "redo" });
    event.preventDefault();
  } else if (command && key.toLowerCase() === "s") {
    send({ type: "save" });
    event.preventDefault();
  } else if (command || typing || event.altKey) return;
  else if (
    key === " " &&
    !(target instanceof HTMLButtonElement && target.id !== "toggle") &&
    target.tagName !== "SUMMARY"
  ) {
    player.toggle();
    event.preventDefault();
  } else if (
    (key === "ArrowLeft" || key === "ArrowRight") &&
    !target.closest("input, canvas, [role=separator]")
  ) {
    const direction = key === "ArrowRight" ? 1 : -1;
    if (event.shiftKey) player.skip(direction);
    else player.step(direction);
    event.preventDefault();
  } else if (key === "f" && target === document.body) view.look("fit");
  else if (key === "g" && target === document.body) view.ghosts.keep();
});

connection.open();

// Access for tests and the console.
Object.assign(window, { studio: { store, player, connection, view, map, plots } });
