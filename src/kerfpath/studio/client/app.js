/** What the page has one of: its state, its connection to the server, and its player. */

import { Connection } from "./connection.js";
import { Player } from "./player.js";
import { Store } from "./store.js";

export const store = new Store();
export const player = new Player();
export const connection = new Connection(
  (message) => store.take(message),
  (status, retryAt) => store.connected(status, retryAt),
);

/**
 * Send a message to the server; false if the connection is not open.
 * @param {import("./messages.js").ClientMessage} message
 */
export const send = (message) => connection.send(message);
