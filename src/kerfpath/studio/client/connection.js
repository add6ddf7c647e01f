/** The connection to the server: it sends and receives messages, and reconnects. */

/** @import { ClientMessage, ServerMessage } from "./messages.js" */
/** @typedef {"connecting" | "open" | "lost"} Status */

const FIRST_WAIT = 500;
const LONGEST_WAIT = 5000;

/** A WebSocket that is opened again whenever it breaks. What is sent while it is down is dropped. */
export class Connection {
  /**
   * @param {(message: ServerMessage) => void} onMessage
   * @param {(status: Status, retryAt: number | null) => void} onStatus  retryAt: ms, as Date.now()
   */
  constructor(onMessage, onStatus) {
    this.onMessage = onMessage;
    this.onStatus = onStatus;
    /** @type {WebSocket | null} */
    this.socket = null;
    this.wait = FIRST_WAIT;
    this.timer = 0;
  }

  /** Connect, now; also what "try now" does. */
  open() {
    clearTimeout(this.timer);
    this.socket?.close();
    const scheme = location.protocol === "https:" ? "wss:" : "ws:";
    const socket = new WebSocket(`${scheme}//${location.host}/ws${location.search}`);
    this.socket = socket;
    this.onStatus("connecting", null);
    socket.addEventListener("open", () => {
      if (socket !== this.socket) return;
      this.wait = FIRST_WAIT;
      this.onStatus("open", null);
    });
    socket.addEventListener("message", (event) => {
      if (socket === this.socket) this.onMessage(JSON.parse(event.data));
    });
    socket.addEventListener("close", () => {
      if (socket !== this.socket) return;
      this.socket = null;
      this.timer = window.setTimeout(() => this.open(), this.wait);
      this.onStatus("lost", Date.now() + this.wait);
      this.wait = Math.min(this.wait * 1.6, LONGEST_WAIT);
    });
  }

  /**
   * Send a message; false if the connection is not open.
   * @param {ClientMessage} message
   * @returns {boolean}
   */
  send(message) {
    if (this.socket?.readyState !== WebSocket.OPEN) return false;
    this.socket.send(JSON.stringify(message));
    return true;
  }
}
