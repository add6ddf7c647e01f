/** No feasible path: where it breaks, why, what is proved, and buttons for changes that help. */

import { send } from "../app.js";
import { millimetres, sum } from "../format.js";
import { dot, html, icon } from "../ui.js";

/** @typedef {import("../messages.js").NoPathMessage} NoPathMessage */

const SCOPES = {
  "every gamma": "Proved: no motion exists, whatever the rotation, posture and turn.",
  grid: "Proved on this grid of gamma; between its samples a motion may exist.",
  undecided: "Not proved: no motion was found, but one may exist.",
};
const NOTHING =
  "No single change was found that makes a path. Move the part, or allow more postures.";

/**
 * Why a contour has no path, and what would help.
 * @param {NoPathMessage} answer
 * @param {() => void} show  shows the place where it breaks
 */
export function noPath(answer, show) {
  const { node, s, reasons } = answer;
  const total = sum(reasons.map(({ count }) => count)) || 1;
  const at = s === null ? "" : `at ${millimetres(s)} of the path, `;
  const place =
    node < 0 ? "Its first node has no admitted pose." : `It breaks ${at}after node ${node + 1}.`;
  return html`
    <div class="alert">
      ${icon("warning")}
      <div>
        <strong>No feasible path</strong>
        <p>${place}</p>
        <p class="quiet">${SCOPES[answer.scope]}</p>
      </div>
    </div>
    <p hidden=${!answer.point}>
      <button class="plain" onClick=${show}>${icon("follow")}Show the place</button>
    </p>
    <h3 class="sub">Reasons of loss there</h3>
    <ul class="reasons">
      ${reasons.slice(0, 6).map(
        ({ name, count }) => html`
          <li>
            <span>${name}</span><b>${count}</b><i style=${{ width: `${(100 * count) / total}%` }} />
          </li>`,
      )}
    </ul>
    <h3 class="sub">What would help</h3>
    ${remedies(answer)}
    <details><summary>Details</summary><p class="quiet">${answer.statement}</p></details>`;
}

/** @param {NoPathMessage} answer */
function remedies({ contour, relaxations, remedy }) {
  if (!relaxations)
    return html`
      <p class="waiting">
        ${dot("busy")}Searching for the smallest change that makes a path.
      </p>`;
  const words = relaxations.length ? remedy : remedy || NOTHING;
  return html`
    ${relaxations.map(
      ({ label }, index) => html`
        <button class="plain remedy" onClick=${() => send({ type: "relax", contour, index })}>
          ${icon("check")}<span>${label}</span>
        </button>`,
    )}
    ${words && html`<p class="quiet">${words}</p>`}`;
}
