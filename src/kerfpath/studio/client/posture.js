/** Pictures of postures: an arm in outline, from the side. */

import { html } from "./ui.js";

const [FLANGE, TIP] = ["18 7", "19.5 14.5"];

/**
 * A picture of a posture by its name, such as "front/up/plus"; null for names of other words.
 * @param {string} name
 */
export function posturePicture(name) {
  const words = name.split("/");
  const rear = words.includes("rear");
  if (!rear && !words.includes("front")) return null;
  const shoulder = rear ? "4.5 10.5" : "9 10.5"; // the base turns it away from the part, or to it
  const elbow = words.includes("down") ? "13 13.5" : words.includes("up") ? "11 2.5" : null;
  const wrist = words.includes("minus") ? "14.8 10.5" : words.includes("plus") ? "22 9.5" : null;
  const arm = elbow ? `M${shoulder} L${elbow} L${FLANGE}` : `M${shoulder} L${FLANGE}`;
  const head = `M${FLANGE} ${wrist ? `L${wrist} ` : ""}L${TIP}`;
  return html`
    <svg class="posture" viewBox="0 0 24 18" aria-hidden="true">
      <path class="base" d=${`M3 17h8M7 17V13L${shoulder}`} /><path d=${arm} />
      <path class="head" d=${head} />
      ${[shoulder, elbow, FLANGE].map((at) => {
        const [x, y] = at?.split(" ") ?? [];
        return at && html`<circle cx=${x} cy=${y} r="1.3" />`;
      })}
    </svg>`;
}
