/** The stage: renderer, camera, lights and floor; a frame is drawn only when something changed. */

import {
  Box3,
  DirectionalLight,
  GridHelper,
  HemisphereLight,
  PerspectiveCamera,
  Scene,
  Vector2,
  Vector3,
  WebGLRenderer,
} from "three";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";

import { ARROWS, onNextFrame, pixelRatio, themeColour } from "../dom.js";

/** Directions from which the views look, z up. */
const VIEWS = {
  fit: new Vector3(1.0, -1.5, 0.85),
  part: new Vector3(0.8, -0.9, 1.1),
  top: new Vector3(0, -0.001, 1),
  front: new Vector3(0, -1, 0),
  side: new Vector3(1, 0, 0),
};

export class Stage {
  /** @param {HTMLCanvasElement} canvas */
  constructor(canvas) {
    this.canvas = canvas;
    this.renderer = new WebGLRenderer({ canvas, antialias: true, alpha: true });
    this.renderer.setClearAlpha(0);
    this.scene = new Scene();
    this.camera = new PerspectiveCamera(32, 1, 0.01, 100);
    this.camera.up.set(0, 0, 1);
    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.zoomToCursor = true;
    this.controls.addEventListener("change", () => this.invalidate());
    this.controls.addEventListener("start", () => (this.held = null));
    this.sky = new HemisphereLight(0xffffff, 0x8d99a8, 1.9);
    this.sky.position.set(0, 0, 1);
    this.sun = new DirectionalLight(0xffffff, 1.7);
    this.scene.add(this.sky, this.sun, this.camera);
    this.size = new Vector2();
    /** @type {[string, Vector3[]] | null} what is looked at, and what is to stay whole */
    this.looked = this.held = null;
    /** Called with each frame, while it can be copied. @type {() => void} */
    this.drawn = () => {};
    /** Draw once, before the next frame of the screen. */
    this.invalidate = onNextFrame(() => this.draw());
    this.frames = 0;
    this.cost = 0;
    /** @type {GridHelper | null} */
    this.floor = null;
    new ResizeObserver(() => this.resize()).observe(canvas);
    canvas.addEventListener("keydown", (event) => this.key(event));
    canvas.addEventListener("webglcontextrestored", () => this.invalidate());
    this.look("fit", [new Vector3(-1, -1, 0), new Vector3(2, 1, 2)]);
    this.resize();
  }

  /** Keep what is looked at whole while the canvas changes its size, until a person moves it. */
  hold() {
    this.held = this.looked;
  }

  draw() {
    const begin = performance.now();
    this.sun.position.copy(this.camera.position).add(new Vector3(0.6, -0.4, 1.6));
    this.renderer.render(this.scene, this.camera);
    this.drawn();
    this.cost = performance.now() - begin;
    this.frames++;
  }

  resize() {
    const { clientWidth: width, clientHeight: height } = this.canvas;
    if (!width || !height) return;
    this.size.set(width, height);
    this.renderer.setPixelRatio(pixelRatio());
    this.renderer.setSize(width, height, false);
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
    if (this.held) this.look(...this.held);
    this.draw(); // at once: a resized canvas is empty
  }

  /**
   * Draw a floor of squares of 250 mm under a box.
   * @param {Box3} box
   * @param {number} z  m
   */
  layFloor(box, z) {
    this.floor?.removeFromParent();
    this.floor?.dispose();
    const size = box.getSize(new Vector3());
    const squares = 2 * Math.ceil(Math.max(size.x, size.y) / 0.5);
    const [main, line] = ["--floor-main", "--floor-line"].map(themeColour);
    this.floor = new GridHelper(squares * 0.25, squares, main, line);
    this.floor.rotation.x = Math.PI / 2;
    const whole = (/** @type {number} */ at) => Math.round(at / 0.25) * 0.25;
    this.floor.position.set(
      whole((box.min.x + box.max.x) / 2),
      whole((box.min.y + box.max.y) / 2),
      z,
    );
    this.scene.add(this.floor);
  }

  /**
   * Look at points from one of the views, as near as possible with all of them in the picture.
   * @param {keyof typeof VIEWS | string} name
   * @param {Vector3[]} points
   */
  look(name, points) {
    this.looked = [name, points];
    if (this.held && this.held[1] !== points) this.held = null;
    const box = new Box3().setFromPoints(points);
    const direction = (VIEWS[/** @type {keyof typeof VIEWS} */ (name)] ?? VIEWS.fit)
      .clone()
      .normalize();
    const middle = box.getCenter(new Vector3());
    this.camera.position.copy(middle).add(direction);
    this.camera.lookAt(middle);
    this.camera.updateMatrixWorld();
    const inverse = this.camera.matrixWorld.clone().setPosition(0, 0, 0).invert();
    const up = Math.tan((this.camera.fov * Math.PI) / 360) * 0.88;
    const across = up * this.camera.aspect;
    let distance = 0.05;
    for (const point of points) {
      const corner = point.clone().sub(middle).applyMatrix4(inverse);
      distance = Math.max(
        distance,
        corner.z + Math.abs(corner.x) / across,
        corner.z + Math.abs(corner.y) / up,
      );
    }
    this.camera.position.copy(middle).addScaledVector(direction, distance);
    this.controls.target.copy(middle);
    this.controls.update();
    this.invalidate();
  }

  /**
   * Move the camera with what has moved, so that the view stays.
   * @param {import("three").Matrix4} motion
   */
  move(motion) {
    this.camera.position.applyMatrix4(motion);
    this.controls.target.applyMatrix4(motion);
    this.controls.update();
    this.invalidate();
  }

  /**
   * Move the camera and its target by the same vector.
   * @param {Vector3} by
   */
  carry(by) {
    this.camera.position.add(by);
    this.controls.target.add(by);
    this.controls.update();
  }

  /** @param {KeyboardEvent} event */
  key(event) {
    const turn = ARROWS[event.key];
    const zoom = { "+": 0.88, "=": 0.88, "-": 1 / 0.88 }[event.key];
    if (event.ctrlKey || event.metaKey || event.altKey || event.shiftKey || (!turn && !zoom))
      return;
    this.held = null;
    const offset = this.camera.position.clone().sub(this.controls.target);
    if (turn) {
      offset.applyAxisAngle(this.camera.up, turn[0] * 0.12);
      const side = new Vector3().crossVectors(this.camera.up, offset).normalize();
      const turned = offset.clone().applyAxisAngle(side, turn[1] * 0.12);
      if (turned.angleTo(this.camera.up) > 0.03 && turned.angleTo(this.camera.up) < 3.1)
        offset.copy(turned);
    } else offset.multiplyScalar(zoom ?? 1);
    this.camera.position.copy(this.controls.target).add(offset);
    this.controls.update();
    this.invalidate();
    event.preventDefault();
    event.stopPropagation();
  }

  /**
   * Return where points are on the canvas, in CSS px; z above 1: behind the camera.
   * @param {Vector3} point
   */
  project(point) {
    const seen = point.clone().project(this.camera);
    return { x: ((seen.x + 1) / 2) * this.size.x, y: ((1 - seen.y) / 2) * this.size.y, z: seen.z };
  }
}
