/** A text with numbered lines, one of which is marked; a click or the arrow keys choose another. */

import { el } from "../dom.js";

export class Listing {
  /** @param {(line: number) => void} chosen  takes the number of a line, from 1 on */
  constructor(chosen) {
    this.gutter = el("pre", { class: "gutter", "aria-hidden": "true" });
    this.text = el("pre", { class: "code" });
    this.bar = el("i", { class: "here", hidden: true });
    this.pane = el("div", { class: "pane" }, this.bar, this.gutter, this.text);
    this.element = el(
      "div",
      { class: "listing", tabindex: 0, role: "region", "aria-label": "Text of the program" },
      this.pane,
    );
    this.count = 0;
    /** @type {number} the marked line, 0: none */
    this.line = 0;
    this.element.addEventListener("click", (event) => {
      if (getSelection()?.type === "Range") return; // a text that is copied is no place to go to
      const y = event.clientY - this.text.getBoundingClientRect().top;
      const line = Math.floor(y / this.height()) + 1;
      if (line >= 1 && line <= this.count) chosen(line);
    });
  }

  /** @param {string} text */
  load(text) {
    const lines = text.replace(/\n$/, "").split("\n");
    this.count = lines.length;
    this.text.textContent = lines.join("\n");
    this.gutter.textContent = lines.map((_, i) => i + 1).join("\n");
    this.element.scrollTop = 0;
    this.mark(0);
  }

  /** The height of a line in px. */
  height() {
    return this.text.getBoundingClientRect().height / Math.max(this.count, 1);
  }

  /**
   * Mark a line and bring it into view; 0 marks none.
   * @param {number} line
   */
  mark(line) {
    this.line = line;
    this.bar.hidden = line === 0;
    if (!line) return;
    const { element } = this;
    const height = this.height();
    const top = (line - 1) * height;
    this.bar.style.height = `${height}px`;
    this.bar.style.transform = `translateY(${top}px)`;
    if (top < element.scrollTop || top + height > element.scrollTop + element.clientHeight)
      element.scrollTop = top - element.clientHeight / 2;
  }
}
