/** The header and footer of the page: job, undo and redo, exports, theme, progress, notices. */

import { byId, el, icon } from "../dom.js";

/** @typedef {import("../store.js").Store} Store */
/** @typedef {{send: (message: any) => boolean, open: () => void}} Link */

/**
 * @param {Store} store
 * @param {Link} connection
 * @param {import("../scene/record.js").Extra[]} extras  exports that the page makes itself
 */
export function topBar(store, connection, extras) {
  const send = (/** @type {string} */ type) => () => void connection.send({ type });
  const buttons = /** @type {const} */ ([
    ["undo", "undo", ""],
    ["redo", "redo", ""],
    ["save", "save", "Save job"],
  ]);
  for (const [id, name, text] of buttons) {
    byId(id).append(icon(name), ...(text ? [text] : []));
    byId(id).addEventListener("click", send(id));
  }
  byId("export").append(icon("export"), "Export");
  byId("open-text").append(icon("file"), "Job file");
  byId("open-program").append(icon("file"), "Program");
  menu(store, extras);
  store.on(["job", "connection", "outcome"], draw);
  draw();

  function draw() {
    const { job } = store;
    const live = store.connection === "open" && job !== null;
    const set = (/** @type {string} */ id, /** @type {boolean} */ on) =>
      (byId(id, HTMLButtonElement).disabled = !on);
    set("undo", live && Boolean(job?.undo));
    set("redo", live && Boolean(job?.redo));
    set("save", live && !job?.saved && job?.faults.length === 0);
    set("open-text", live);
    set("open-program", live);
    set("export", live);
    byId("file").textContent = job?.name ?? "Opening the job";
    byId("saved").textContent = !job ? "" : job.saved ? "saved" : "not saved; kept beside the job";
    document.title = job
      ? `${job.saved ? "" : "• "}${job.name} – kerfpath studio`
      : "kerfpath studio";
  }
}

/**
 * @param {Store} store
 * @param {import("../scene/record.js").Extra[]} extras
 */
function menu(store, extras) {
  const [button, list] = [byId("export"), byId("export-menu")];
  const show = (/** @type {boolean} */ open) => {
    list.hidden = !open;
    button.setAttribute("aria-expanded", String(open));
    if (!open) return;
    const { search } = location;
    const entries = store.outcome?.exports ?? [];
    const href = (/** @type {string} */ path) =>
      path.replace(/^\//, "") +
      (search ? (path.includes("?") ? `&${search.slice(1)}` : search) : "");
    list.replaceChildren(
      ...entries.map(({ name, href: path, ready, why }) =>
        ready
          ? el(
              "a",
              {
                href: href(path),
                download: path.startsWith("/report") ? false : true,
                target: path.startsWith("/report") ? "_blank" : null,
              },
              name,
              el("small", {}, why || describe(path)),
            )
          : el("div", { class: "off" }, name, el("small", {}, why)),
      ),
      ...(entries.length
        ? []
        : [
            el(
              "div",
              { class: "off" },
              "Nothing yet",
              el("small", {}, "Files can be exported once every contour is planned."),
            ),
          ]),
      ...extras.map(({ name, about, why, make }) => {
        const [bar, says] = [why(), el("small", {}, why() || about)];
        return bar
          ? el("div", { class: "off" }, name, says)
          : el("button", { class: "entry", onclick: make }, name, says);
      }),
    );
    /** @type {HTMLElement | null} */ (list.querySelector("a, button"))?.focus();
  };
  button.addEventListener("click", () => show(Boolean(list.hidden)));
  document.addEventListener("pointerdown", (event) => {
    if (!list.hidden && !(/** @type {Node} */ (event.target).parentElement?.closest(".menu")))
      show(false);
  });
  list.addEventListener("keydown", (event) => {
    if (event.key === "Escape") {
      show(false);
      button.focus();
    }
    const links = /** @type {HTMLElement[]} */ ([...list.querySelectorAll("a, button")]);
    const at = links.indexOf(/** @type {HTMLElement} */ (document.activeElement));
    const to = { ArrowDown: at + 1, ArrowUp: at - 1 }[event.key];
    if (to !== undefined) {
      links[(to + links.length) % links.length]?.focus();
      event.preventDefault();
    }
  });
  list.addEventListener("click", () => show(false));
}

/** @param {string} path */
const describe = (path) =>
  path.includes("script")
    ? "in Python: the same plans from the public functions"
    : path.includes("job")
      ? "the job file with its comments"
      : path.includes("program")
        ? "in the language of the job"
        : path.includes("trajectory")
          ? "one row for each node"
          : path.includes("report")
            ? "on a separate page"
            : "";

/**
 * @param {Store} store
 * @param {Link} connection
 */
export function foot(store, connection) {
  const [link, doing, cancel] = [byId("link"), byId("doing"), byId("cancel")];
  const bar = byId("bar", HTMLProgressElement);
  cancel.addEventListener("click", () => void connection.send({ type: "cancel" }));
  byId("hint").textContent = "Space plays, arrow keys step, F fits the view, G keeps a ghost";
  store.on(["connection", "progress", "job"], draw);
  draw();

  function draw() {
    const { progress, connection: status } = store;
    const open = status === "open";
    link.replaceChildren(
      el("i", { class: `dot ${open ? "done" : "none"}` }),
      open ? "connected" : status === "lost" ? "not connected" : "connecting",
    );
    const busy = open && progress.busy;
    doing.textContent = busy ? progress.label || "planning" : open && store.job ? "ready" : "";
    bar.hidden = cancel.hidden = !busy;
    if (progress.total > 0) bar.value = progress.done / progress.total;
    else bar.removeAttribute("value");
  }
}

/**
 * Show errors, and what to do about them, above the desk.
 * @param {Store} store
 * @param {Link} connection
 */
export function notices(store, connection) {
  const host = byId("notices");
  /** @typedef {{message: string, timer: number, row: HTMLElement}} Entry */
  /** @type {Entry[]} */
  const errors = [];
  let wasOpen = false;
  let broken = false;
  const send = (/** @type {string} */ type) => () => void connection.send({ type });
  const again = { class: "plain", onclick: () => connection.open() };
  const lost = notice(true, "", el("button", again, "Try now"));
  store.on(["connection", "job"], draw);
  store.on(["error"], (error) => {
    if (errors.some(({ message }) => message === error.message)) return;
    const close = { class: "tool", "aria-label": "Dismiss", onclick: () => drop(entry) };
    const force = () => {
      connection.send({ type: "save", over: true });
      drop(entry);
    };
    const conflict = error.about === "save" && error.message.includes("changed since");
    const over = conflict ? [el("button", { class: "plain", onclick: force }, "Save over it")] : [];
    /** @type {Entry} */
    const entry = {
      message: error.message,
      timer: window.setTimeout(() => drop(entry), 12000),
      row: notice(false, error.message, ...over, el("button", close, icon("close"))),
    };
    errors.push(entry);
    if (errors.length > 3) drop(errors[0]);
    draw();
  });
  window.setInterval(count, 500);
  draw();

  /** @param {Entry} entry */
  function drop(entry) {
    clearTimeout(entry.timer);
    errors.splice(errors.indexOf(entry), 1);
    draw();
  }

  function draw() {
    if (store.connection === "open") wasOpen = true;
    const rows = [];
    if (store.connection !== "open" && lostOnce()) rows.push(lost);
    for (const { key, message } of store.job?.faults ?? []) {
      const undo = { class: "plain", disabled: !store.job?.undo, onclick: send("undo") };
      const text = `${key.length ? `${key.join(".")}: ` : ""}${message}`;
      rows.push(notice(true, text, el("button", undo, icon("undo"), "Undo")));
    }
    for (const entry of errors) rows.push(entry.row);
    const same =
      rows.length === host.children.length && rows.every((row, i) => row === host.children[i]);
    if (!same) host.replaceChildren(...rows);
    count();
  }

  /** Whether the connection has been lost since it was last open. */
  function lostOnce() {
    if (store.connection === "lost") broken = true;
    return broken;
  }

  /** Count down to the next try. */
  function count() {
    if (store.connection === "open") broken = false;
    if (!broken) return;
    const seconds = Math.max(1, Math.ceil(((store.retryAt ?? 0) - Date.now()) / 1000));
    const when = store.connection === "lost" ? `Next try in ${seconds} s.` : "Trying now.";
    const text = wasOpen
      ? `The studio's server has stopped or cannot be reached. All changes are kept beside the job file; start "kerfpath studio" again to continue. ${when}`
      : `The studio's server does not answer. ${when}`;
    const said = lost.querySelector("p");
    if (said && said.textContent !== text) said.textContent = text;
  }
}

/**
 * @param {boolean} bad
 * @param {string} text
 * @param {...HTMLElement} buttons
 */
const notice = (bad, text, ...buttons) =>
  el(
    "div",
    { class: `notice ${bad ? "bad" : ""}` },
    icon("warning"),
    el("p", {}, text),
    ...buttons,
  );
