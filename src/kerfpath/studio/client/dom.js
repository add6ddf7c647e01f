/** Create and find elements; text enters the page only as text, never as HTML. */

/**
 * Return a new element.
 * @template {keyof HTMLElementTagNameMap} K
 * @param {K} tag
 * @param {Record<string, string | number | boolean | ((event: any) => void) | null | undefined>} [attributes]
 *   `on...` names are listeners; true is an attribute without a value; false, null and undefined none
 * @param {...(Node | string | null)} children
 * @returns {HTMLElementTagNameMap[K]}
 */
export function el(tag, attributes = {}, ...children) {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (typeof value === "function") made.addEventListener(name.slice(2), value);
    else if (value === true) made.setAttribute(name, "");
    else if (value !== false && value !== null && value !== undefined)
      made.setAttribute(name, String(value));
  }
  made.append(...children.filter((child) => child !== null));
  return made;
}

const SVG = "http://www.w3.org/2000/svg";

/**
 * Return an icon of the page's sheet, hidden from screen readers.
 * @param {string} name
 * @returns {SVGSVGElement}
 */
export function icon(name) {
  const svg = document.createElementNS(SVG, "svg");
  svg.setAttribute("class", "icon");
  svg.setAttribute("aria-hidden", "true");
  const use = document.createElementNS(SVG, "use");
  use.setAttribute("href", `#i-${name}`);
  svg.append(use);
  return svg;
}

/**
 * Return the element of the page with an id; throws if it is missing.
 * @template {HTMLElement} T
 * @param {string} id
 * @param {new () => T} [kind]
 * @returns {T}
 */
export function byId(id, kind) {
  const found = document.getElementById(id);
  if (!found || (kind && !(found instanceof kind))) throw new Error(`the page has no #${id}`);
  return /** @type {T} */ (found);
}

/** @type {Map<string, string>} cached, as every frame needs them; by theme and name */
const colours = new Map();

/**
 * Return a colour of the current theme, in CSS notation.
 * @param {string} name  of the custom property, as "--ink"
 * @returns {string}
 */
export function themeColour(name) {
  const key = `${document.documentElement.dataset.theme} ${name}`;
  let known = colours.get(key);
  if (known === undefined) {
    known = getComputedStyle(document.documentElement).getPropertyValue(name).trim();
    if (known) colours.set(key, known);
  }
  return known;
}

let size = 0;
addEventListener("resize", () => (size = 0));

/** Return the size of the page's text in px, which canvases also use. */
export function textSize() {
  size ||= parseFloat(getComputedStyle(document.documentElement).fontSize);
  return size;
}

/**
 * Match the resolution of a canvas to its size on the screen.
 * @param {HTMLCanvasElement} canvas
 * @returns {{width: number, height: number, ratio: number, changed: boolean}} in CSS px
 */
export function fitCanvas(canvas) {
  const ratio = Math.min(window.devicePixelRatio || 1, 2);
  const { clientWidth: width, clientHeight: height } = canvas;
  const [w, h] = [Math.round(width * ratio), Math.round(height * ratio)];
  const changed = canvas.width !== w || canvas.height !== h;
  if (changed) Object.assign(canvas, { width: w, height: h });
  return { width, height, ratio, changed };
}
