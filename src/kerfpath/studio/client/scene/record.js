/** Pictures and videos of the scene, which the browser makes and offers as files. */

import { byId, el, themeColour } from "../dom.js";
import { clock } from "../format.js";

/** @typedef {import("../store.js").Store} Store */
/** @typedef {import("../player.js").Player} Player */
/** @typedef {import("./view.js").SceneView} SceneView */

/**
 * An entry of the export menu that the page makes itself.
 * @typedef {object} Extra
 * @property {string} name
 * @property {string} about
 * @property {() => string} why  why it is not available now, or ""
 * @property {() => void} make
 */

const FRAMES = 30; // a second
const BITS = 8e6; // a second
const KINDS = ["video/webm;codecs=vp9", "video/webm;codecs=vp8", "video/webm"];

/**
 * Return the entries of the scene for the export menu.
 * @param {Store} store
 * @param {Player} player
 * @param {SceneView} view
 * @returns {Extra[]}
 */
export function recordings(store, player, view) {
  const film = new Film(store, player, view);
  return [
    {
      name: "picture of the view",
      about: "PNG, in the size of the view",
      why: () => (view.ready ? "" : "the cell is not drawn yet"),
      make: () => picture(store, view),
    },
    {
      name: "video of the motion",
      about: "WebM, at the speed of the player",
      why: () =>
        !player.timeline.spans.length
          ? "nothing is planned yet"
          : film.recorder
            ? "a video is being recorded"
            : film.kind
              ? ""
              : "this browser cannot record WebM",
      make: () => film.begin(),
    },
  ];
}

/**
 * @param {Store} store
 * @param {SceneView} view
 */
function picture(store, view) {
  view.stage.draw();
  const shot = el("canvas");
  Object.assign(shot, { width: view.canvas.width, height: view.canvas.height });
  paint(shot, view.canvas);
  shot.toBlob((blob) => blob && offer(blob, `${stem(store)}.png`), "image/png");
}

/** A recording of the motion from begin to end while it is played. */
class Film {
  /**
   * @param {Store} store
   * @param {Player} player
   * @param {SceneView} view
   */
  constructor(store, player, view) {
    this.store = store;
    this.player = player;
    this.view = view;
    this.kind = KINDS.find((kind) => globalThis.MediaRecorder?.isTypeSupported(kind)) ?? "";
    /** @type {MediaRecorder | null} */
    this.recorder = null;
    this.canvas = el("canvas");
    this.host = byId("recording");
    this.said = el("span");
    this.bar = el("progress", { max: 1, value: 0, "aria-label": "Recorded" });
    const end = (/** @type {boolean} */ keep) => () => this.end(keep);
    this.host.append(
      el("i", { class: "dot none" }),
      this.said,
      this.bar,
      el("button", { class: "text", onclick: end(true) }, "Stop and keep"),
      el("button", { class: "text", onclick: end(false) }, "Cancel"),
    );
    view.stage.drawn = () => this.recorder && paint(this.canvas, view.canvas);
    player.on(() => this.follow());
  }

  begin() {
    const { canvas, view, player } = this;
    // Videos have an even number of rows and columns.
    const [width, height] = [view.canvas.width, view.canvas.height].map((each) => each & ~1);
    Object.assign(canvas, { width, height });
    paint(canvas, view.canvas);
    /** @type {Blob[]} */
    const pieces = [];
    const recorder = new MediaRecorder(canvas.captureStream(FRAMES), {
      mimeType: this.kind,
      videoBitsPerSecond: BITS,
    });
    recorder.addEventListener("dataavailable", ({ data }) => pieces.push(data));
    recorder.addEventListener("stop", () => {
      for (const track of recorder.stream.getTracks()) track.stop();
      if (this.keep) offer(new Blob(pieces, { type: "video/webm" }), `${stem(this.store)}.webm`);
    });
    this.keep = false;
    player.pause();
    player.seek(0);
    recorder.start(1000);
    this.recorder = recorder;
    this.host.hidden = false;
    player.play();
    this.follow();
  }

  /** Follow the player, which may be paused; the recording ends with it. */
  follow() {
    const { recorder, player } = this;
    if (!recorder) return;
    const { t, timeline, playing } = player;
    this.said.textContent = `Recording ${clock(t, 0)} of ${clock(timeline.total, 0)}`;
    this.bar.value = timeline.total ? t / timeline.total : 1;
    if (t >= timeline.total) this.end(true);
    else if (playing && recorder.state === "paused") recorder.resume();
    else if (!playing && recorder.state === "recording") recorder.pause();
  }

  /** @param {boolean} keep */
  end(keep) {
    const { recorder } = this;
    if (!recorder) return;
    this.recorder = null;
    this.keep = keep;
    this.host.hidden = true;
    this.player.pause();
    recorder.stop();
  }
}

/**
 * Draw a canvas on another one, over the background of the theme.
 * @param {HTMLCanvasElement} target
 * @param {HTMLCanvasElement} scene
 */
function paint(target, scene) {
  const context = /** @type {CanvasRenderingContext2D} */ (target.getContext("2d"));
  const { width, height } = target;
  const sky = context.createLinearGradient(0, 0, 0, height);
  sky.addColorStop(0, themeColour("--sky-top"));
  sky.addColorStop(1, themeColour("--sky-bottom"));
  context.fillStyle = sky;
  context.fillRect(0, 0, width, height);
  context.drawImage(scene, 0, 0, width, height);
}

/**
 * Offer a file.
 * @param {Blob} blob
 * @param {string} name
 */
function offer(blob, name) {
  const href = URL.createObjectURL(blob);
  el("a", { href, download: name }).click();
  setTimeout(() => URL.revokeObjectURL(href), 60_000);
}

/** @param {Store} store */
const stem = (store) => (store.job?.name ?? "studio").replace(/\.toml$/, "");
