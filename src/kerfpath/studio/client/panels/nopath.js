/** No feasible path: where it breaks, why, what is proved, and buttons for changes that help. */

import { el, icon } from "../dom.js";
import { millimetres } from "../format.js";

/** @typedef {import("../messages.js").NoPathMessage} NoPathMessage */

const SCOPES = {
  "every gamma": "Proved: no motion exists, whatever the rotation, posture and turn.",
  grid: "Proved on this grid of gamma; between its samples a motion may exist.",
  undecided: "Not proved: no motion was found, but one may exist.",
};

/**
 * Return the elements for a contour without a path.
 * @param {NoPathMessage} answer
 * @param {{send: (message: any) => boolean}} connection
 * @param {{look: (view: string) => void}} view
 * @returns {Node[]}
 */
export function noPath(answer, connection, view) {
  const total = answer.reasons.reduce((sum, { count }) => sum + count, 0) || 1;
  const place =
    answer.node < 0
      ? "Its first node has no admitted pose."
      : `It breaks ${answer.s === null ? "" : `at ${millimetres(answer.s)} of the path, `}after node ${answer.node + 1}.`;
  return [
    el(
      "div",
      { class: "alert" },
      icon("warning"),
      el(
        "div",
        {},
        el("strong", {}, "No feasible path"),
        el("p", {}, place),
        el("p", { class: "quiet" }, SCOPES[answer.scope]),
      ),
    ),
    ...(answer.point
      ? [
          el(
            "p",
            {},
            el(
              "button",
              { class: "plain", onclick: () => view.look("mark") },
              icon("follow"),
              "Show the place",
            ),
          ),
        ]
      : []),
    el("h3", { class: "sub" }, "Reasons of loss there"),
    el(
      "ul",
      { class: "reasons" },
      ...answer.reasons.slice(0, 6).map(({ name, count }) => {
        const row = el("li", {}, el("span", {}, name), el("b", {}, String(count)), el("i"));
        /** @type {HTMLElement} */ (row.lastChild).style.width = `${(100 * count) / total}%`;
        return row;
      }),
    ),
    el("h3", { class: "sub" }, "What would help"),
    ...(answer.relaxations === null
      ? [
          el(
            "p",
            { class: "waiting" },
            el("i", { class: "dot busy" }),
            "Searching for the smallest change that makes a path.",
          ),
        ]
      : answer.relaxations.length
        ? answer.relaxations.map(({ label }, index) =>
            el(
              "button",
              {
                class: "plain remedy",
                onclick: () => connection.send({ type: "relax", contour: answer.contour, index }),
              },
              icon("check"),
              el("span", {}, label),
            ),
          )
        : [
            el(
              "p",
              { class: "quiet" },
              answer.remedy ||
                "No single change was found that makes a path. Move the part, or allow more postures.",
            ),
          ]),
    ...(answer.relaxations?.length && answer.remedy
      ? [el("p", { class: "quiet" }, answer.remedy)]
      : []),
    el("details", {}, el("summary", {}, "Details"), el("p", { class: "quiet" }, answer.statement)),
  ];
}
