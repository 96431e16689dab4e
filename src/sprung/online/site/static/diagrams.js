// Refreshes the page while the diagrams are being computed.

import { refresh } from "./base.js";

const WAIT = 3000;

async function look() {
  if (!document.querySelector("[data-busy]")) return;
  try {
    await refresh();
  } catch {
    // The server may be restarting: try again.
  }
  setTimeout(look, WAIT);
}

setTimeout(look, WAIT);
