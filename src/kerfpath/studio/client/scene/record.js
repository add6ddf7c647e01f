/** Pictures and videos of the scene, which the browser makes and offers as files. */

import { player, store } from "../app.js";
import { byId, themeColour } from "../dom.js";
import { clock } from "../format.js";
import { dot, draw, html } from "../ui.js";

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
 * @param {SceneView} view
 * @returns {Extra[]}
 */
export function recordings(view) {
  const film = new Film(view);
  return [
    {
      name: "picture of the view",
      about: "PNG, in the size of the view",
      why: () => (view.ready ? "" : "the cell is not drawn yet"),
      make: () => picture(view),
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

/** @param {SceneView} view */
function picture(view) {
  view.stage.draw();
  const shot = document.createElement("canvas");
  Object.assign(shot, { width: view.canvas.width, height: view.canvas.height });
  paint(shot, view.canvas);
  shot.toBlob((blob) => blob && offer(blob, `${stem()}.png`), "image/png");
}

/** A recording of the motion from begin to end while it is played. */
class Film {
  /** @param {SceneView} view */
  constructor(view) {
    this.view = view;
    this.kind = KINDS.find((kind) => globalThis.MediaRecorder?.isTypeSupported(kind)) ?? "";
    /** @type {MediaRecorder | null} */
    this.recorder = null;
    this.canvas = document.createElement("canvas");
    this.host = byId("recording");
    view.stage.drawn = () => this.recorder && paint(this.canvas, view.canvas);
    player.on(() => this.follow());
  }

  begin() {
    const { canvas, view } = this;
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
      if (this.keep) offer(new Blob(pieces, { type: "video/webm" }), `${stem()}.webm`);
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
    const { recorder } = this;
    if (!recorder) return;
    const { t, timeline, playing } = player;
    draw(
      this.host,
      html`
        ${dot("none")}
        <span>Recording ${clock(t, 0)} of ${clock(timeline.total, 0)}</span>
        <progress max="1" value=${timeline.total ? t / timeline.total : 1} aria-label="Recorded" />
        <button class="text" onClick=${() => this.end(true)}>Stop and keep</button>
        <button class="text" onClick=${() => this.end(false)}>Cancel</button>`,
    );
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
    player.pause();
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
  Object.assign(document.createElement("a"), { href, download: name }).click();
  setTimeout(() => URL.revokeObjectURL(href), 60_000);
}

const stem = () => (store.job?.name ?? "studio").replace(/\.toml$/, "");
